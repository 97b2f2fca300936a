#pragma once

#include <optional>
#include <vector>

#include "rotodom/types/triangulation.h"

namespace rotslam {

/// A triangulated point and its inliers.
struct RobustPoint {
  Eigen::Vector3d point_in_world;
  std::vector<int> inliers;  // positions in the rays, ascending
};

/// Positions of the rays whose bearing error is at most `threshold_rad`, ascending.
std::vector<int> InliersOf(const std::vector<PosedRay>& rays,
                           const Eigen::Vector3d& point,
                           double threshold_rad);

/// Triangulates a point from rays with outliers: from all of them first, then from pairs. The
/// hypothesis with the most inliers is refined on these.
/// @return  nullopt when fewer than two rays agree to `threshold_rad` in front of their
///          cameras with at least `min_angle_rad` of parallax, or when they are not the majority.
std::optional<RobustPoint> TriangulateRobustly(const std::vector<PosedRay>& rays,
                                               double min_angle_rad,
                                               double threshold_rad);

}  // namespace rotslam
