#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "rotodom/camera/camera.h"
#include "rotodom/features/view.h"
#include "rotodom/relative_rotation/bearing_pair.h"
#include "rotodom/rolling_shutter/rolling_shutter.h"
#include "rotodom/tracking/flow_field.h"

namespace rotslam {

/// Of tracking features from image to image.
struct TrackingOptions {
  // Normalised correlation that a patch must reach where it was found; less lets points slide onto
  // other things, more loses them in blur.
  double min_correlation = 0.7;
  // Views whose patches a point is aligned with; its position is the mean. More average the noise
  // of the patches and cost time.
  int num_references = 2;
  // Points found must be at least this many and this share of those sought, else the prediction
  // was wrong and the frame is matched by descriptors.
  int min_points = 150;
  double min_found_ratio = 0.3;
  // Where the camera turns faster in one of two images than in the other, patches are sought with
  // both blurred alike, by the time of exposure that the images tell; with a rolling shutter by
  // completion alone.
  bool match_blur = true;

  std::optional<std::string> Problem() const;

  // Not configuration: the members that are not visited; programs and tests set them.
  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("min_correlation", min_correlation);
    visit("num_references", num_references);
    visit("min_points", min_points);
    visit("match_blur", match_blur);
  }
};

/// The image in which points are sought, and where they are expected.
struct TrackingTarget {
  const ImagePyramid* pyramid = nullptr;
  double timestamp_s = 0.0;
  Rotation cam_from_world;
  // Of the camera at the target, for a rolling shutter.
  AngularMotion motion;
  // When given, the motion beside the rotation; otherwise each point goes on with its own.
  const FlowField* flow = nullptr;
  // Of the target and the views; where they turned at different rates, that much more of the one
  // is blurred. 0: nothing is.
  double exposure_s = 0.0;
  // Points beyond this number that are not in the newest view are not looked for.
  int max_points = 2000;
};

/// A point of an older view, found in the target.
struct TrackedPoint {
  TrackId track;
  int view = 0;   // position in `views` of the newest one that shows it
  int index = 0;  // its keypoint there
  Eigen::Vector2d keypoint_px;
  Eigen::Matrix2d covariance_px;  // px^2, from the patch's structure and residual
};

struct TrackingResult {
  Rotation cam_from_world;           // the target's prediction, corrected by the probes
  std::vector<TrackedPoint> points;  // ascending in `track`
  int num_sought = 0;                // points whose expected place lies inside the image

  bool IsPoor(const TrackingOptions& options) const;
};

/// Looks for the points of `views` in the target by aligning the patches around them, each turned
/// as the rotation between the two views says.
///
/// A few probes, spread over the image and sought over a longer way, correct the predicted
/// rotation first; then every point is sought from where it is expected, from the newest view that
/// shows it, and sharpened against older ones.
/// @param views  newest first.
/// @return  the answer does not depend on num_threads.
/// Error:   about 0.03 px on clean images (tracking tests); up to 20 px of error in the prediction
/// are caught by the probes, up to 5 px in each point's own motion.
/// Cost:    about 2 us a point and reference.
TrackingResult TrackPoints(std::span<const OrientedView> views,
                           const TrackingTarget& target,
                           const Camera& camera,
                           const TrackingOptions& options,
                           int num_threads);

/// Rotation that best aligns most of the pairs' bearings, R f_i ~ f_j, whatever the others do.
/// @return  nullopt for fewer than ten pairs.
std::optional<Rotation> AlignMostBearings(const std::vector<BearingPair>& pairs);

}  // namespace rotslam
