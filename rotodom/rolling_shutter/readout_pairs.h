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

/// A signed readout: along columns (0) or rows (1) of the image, from its left or top where it is
/// positive.
struct Readout {
  int axis = 1;
  double seconds = 0.0;
};

/// Where a frame shows a point.
struct FrameSight {
  double late_s = 0.0;    // the middle of that frame
  Eigen::Vector2d place;  // from the middle of the image, in its widths and heights
  Eigen::Vector3d bearing;
};

/// A point in a frame, and in the frames before and behind where both show it.
struct SeenPoint {
  FrameSight here;
  std::optional<std::array<FrameSight, 2>> around;
};

/// Two views, and the points that both see, in the same order.
struct ViewPair {
  FrameId i;
  FrameId j;
  AngularMotion motion_i;
  AngularMotion motion_j;
  std::vector<SeenPoint> in_i;
  std::vector<SeenPoint> in_j;
  Rotation predicted_j_from_i;
  double rate_difference = 0.0;  // rad/s: of a readout, it shears so much of every second

  /// Of the points in the middle of their frames, where the camera has that readout.
  std::vector<BearingPair> BearingsFor(const Readout& readout) const;
};

/// Time between two frames, the median; at least two frames.
double MedianPeriod(const std::map<FrameId, SeenPoints>& frames);

/// Pairs of views that tell most of a readout, 300 to 600 where there are as many, in order of
/// time: they turn at different rates, their matches scatter little, their motion is known. Points
/// that both and, where they can, the frames around see; at least 50.
/// @param frames      as EstimateReadout takes them, like the rest.
/// @param longest_s   the longest readout that is sought.
std::vector<ViewPair> PairsThatTell(const Camera& camera,
                                    const std::map<FrameId, SeenPoints>& frames,
                                    const ViewGraph& graph,
                                    const RotationMap& cam_from_world,
                                    double longest_s);

}  // namespace rotslam
