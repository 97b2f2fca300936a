#pragma once

#include <array>
#include <map>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "rotodom/camera/camera.h"
#include "rotodom/relative_rotation/bearing_pair.h"
#include "rotodom/rolling_shutter/rolling_shutter.h"
#include "rotodom/rolling_shutter/seen_points.h"
#include "rotodom/types/maps.h"
#include "rotodom/types/view_graph.h"

namespace rotslam {

/// A signed readout along columns (0) or rows (1) of the image. A positive one starts at the left
/// or top.
struct Readout {
  int axis = 1;
  double seconds = 0.0;
};

/// Observation of a point in a frame.
struct FrameObservation {
  double time_s = 0.0;    // mid-frame time of that frame, relative to the frame at hand
  Eigen::Vector2d place;  // from the image centre, in units of width and height
  Eigen::Vector3d bearing;
};

/// Observations of a point in a frame, and in the frames before and after where both see it.
struct SeenPoint {
  FrameObservation here;
  std::optional<std::array<FrameObservation, 2>> around;
};

/// Two views and their common points, in the same order.
struct ViewPair {
  FrameId i;
  FrameId j;
  AngularMotion motion_i;
  AngularMotion motion_j;
  std::vector<SeenPoint> in_i;
  std::vector<SeenPoint> in_j;
  // The edge's.
  Rotation predicted_j_from_i;
  Eigen::Vector3d translation_direction;
  double rate_difference = 0.0;  // rad/s: shear per second of readout

  /// Whether the camera rotates faster in view j than in view i, in the direction of the rotation
  /// between them.
  bool RotatesFaster() const;

  /// Bearings of the points moved to mid-frame, for a camera with that readout.
  std::vector<BearingPair> BearingsFor(const Readout& readout) const;
};

/// Median time between two frames; there must be at least two.
double MedianPeriod(const std::map<FrameId, SeenPoints>& frames);

/// Selects the pairs of views that are most informative about the readout, 300 to 600 where there
/// are as many, in order of time: different rotation rates, small noise of the matches, known
/// motion, at least 50 common points.
/// @param frames     this and the following arguments are those of EstimateReadout.
/// @param longest_s  upper bound of the readout, s.
std::vector<ViewPair> SelectReadoutPairs(const Camera& camera,
                                         const std::map<FrameId, SeenPoints>& frames,
                                         const ViewGraph& graph,
                                         const RotationMap& cam_from_world,
                                         double longest_s);

}  // namespace rotslam
