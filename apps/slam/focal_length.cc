#include "apps/slam/focal_length.h"

#include <algorithm>
#include <cmath>

#include "apps/slam/build_map.h"
#include "apps/slam/orientations.h"
#include "apps/slam/readout_decision.h"

namespace rotslam {
namespace {

// Frames that a pass looks at: enough movement for a focal length, in bounded time.
constexpr int kMaxFrames = 600;

// Orientations that a wrong focal length has bent hold on to it: from half as much again the images
// say 12 % too much, and from there the truth. So passes go on until one changes less than this
// share.
constexpr double kTolerance = 0.05;
constexpr int kMaxPasses = 4;

// What a pass leaves out: it wants the focal length alone.
SlamOptions OptionsOfPass(SlamOptions options) {
  options.loop.use_loops = false;
  options.krot.use_bracket = options.krot.start == "bisection";
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
  // A share: a guess says next to nothing.
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
