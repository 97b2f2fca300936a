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

/// Options of the tracking of features from image to image.
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

/// The image in which points are tracked, and the predicted motion.
struct TrackingTarget {
  const ImagePyramid* pyramid = nullptr;
  double timestamp_s = 0.0;
  Rotation cam_from_world;
  // Motion of the camera during the target's exposure, for a rolling shutter.
  AngularMotion motion;
  // When set, the image motion beside that of the rotation; otherwise each point keeps its own.
  const FlowField* flow = nullptr;
  // Exposure time of the target and the views. Where they rotate at different rates, one of the
  // patches is blurred accordingly. 0: no blurring.
  double exposure_s = 0.0;
  // Beyond this number, points that are not in the newest view are not tracked.
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
  int num_sought = 0;                // points whose predicted position is inside the image

  bool IsPoor(const TrackingOptions& options) const;
};

/// Tracks the points of `views` into the target by aligning the patches around them, warped by the
/// rotation between the two views.
///
/// A few probes, spread over the image and with a larger search range, first correct the predicted
/// rotation. Then each point is aligned from its prediction with the patch of the newest view that
/// sees it, and refined against older views.
/// @param views  newest first.
/// Points in masked parts of the target are not tracked.
/// @return  the same at any num_threads.
/// Error:   about 0.03 px on clean images (tracking tests). The probes correct predictions that are
///          off by up to 20 px; the motion of each point may differ by up to 5 px.
/// Cost:    about 2 us per point and reference.
TrackingResult TrackPoints(std::span<const OrientedView> views,
                           const TrackingTarget& target,
                           const Camera& camera,
                           const TrackingOptions& options,
                           int num_threads);

/// Rotation that best aligns most of the pairs' bearings, R f_i ~ f_j; robust to outliers.
/// @return  nullopt for fewer than ten pairs.
std::optional<Rotation> AlignMostBearings(const std::vector<BearingPair>& pairs);

}  // namespace rotslam
