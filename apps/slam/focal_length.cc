#include "apps/slam/focal_length.h"

#include <algorithm>
#include <cmath>

#include "apps/slam/build_map.h"
#include "apps/slam/orientations.h"
#include "apps/slam/readout_decision.h"

namespace rotslam {
namespace {

// Frames per pass: enough motion to determine a focal length, at a bounded time.
constexpr int kMaxFrames = 600;

// A pass changes the focal length less than it should, because the orientations were computed with
// the wrong one. From a start that is 50 % too long the first pass ends 12 % too long, and the
// second one at the right value. Passes end when one changes the focal length by less than this
// share.
constexpr double kTolerance = 0.05;
constexpr int kMaxPasses = 4;  // twice what a start that is 50 % off needs

// Options without the stages that do not contribute to the focal length.
SlamOptions OptionsOfPass(SlamOptions options) {
  options.loop.use_loops = false;
  options.krot.use_bracket = options.krot.start == KrotStart::kBisection;
  options.ba.find_covariance = false;
  FreeFocalLength(options.ba.lens);
  return options;
}

}  // namespace

double GuessFocalLength(const cv::Size& image_size) {
  return 1.2 * std::max(image_size.width, image_size.height);
}

Camera UncalibratedCamera(const cv::Size& image_size, double focal_px) {
  Camera camera;
  camera.width = image_size.width;
  camera.height = image_size.height;
  camera.fx = camera.fy = focal_px;
  camera.cx = 0.5 * (image_size.width - 1);
  camera.cy = 0.5 * (image_size.height - 1);
  return camera;
}

void FreeFocalLength(LensOptions& lens) {
  lens.refine_focal = true;
  // Relative standard deviation: a prior of 100 %, since the guess has no accuracy to speak of.
  lens.focal_sigma = 1.0;
}

FocalLengthEstimate FindFocalLength(FrameSource& frames,
                                    const Camera& camera,
                                    const SlamOptions& options,
                                    SlamObserver& observer) {
  FocalLengthEstimate estimate;
  estimate.camera = camera;
  const SlamOptions options_of_pass = OptionsOfPass(options);
  for (int pass = 1; pass <= kMaxPasses; ++pass) {
    const double before_px = estimate.camera.fx;
    observer.OnFocalPass(pass, before_px);
    frames.Rewind();
    FirstFrames beginning(frames, kMaxFrames);
    const Orientations orientations =
        FindOrientations(beginning, estimate.camera, options_of_pass, {}, observer);
    if (orientations.readout) estimate.readout = orientations.readout;
    estimate.camera = orientations.camera;
    estimate.interrupted = orientations.interrupted;
    if (estimate.interrupted) break;
    const MapResult map = BuildKeyframeMap(orientations, options_of_pass, observer);
    if (map.camera.fx != estimate.camera.fx) {
      estimate.is_found = true;
      estimate.camera = UncalibratedCamera({camera.width, camera.height}, map.camera.fx);
      if (estimate.readout) estimate.camera = WithReadout(estimate.camera, *estimate.readout);
    }
    if (std::abs(estimate.camera.fx - before_px) <= kTolerance * before_px) break;
  }
  frames.Rewind();
  return estimate;
}

}  // namespace rotslam
