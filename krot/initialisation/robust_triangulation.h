#pragma once

#include <optional>
#include <vector>

#include "rotodom/types/triangulation.h"

namespace rotslam {

/// A triangulated point and who agrees with it.
struct RobustPoint {
  Eigen::Vector3d point_in_world;
  std::vector<int> inliers;  // positions in the sightings, ascending
};

/// Point from sightings of which some are wrong: all of them first, then pairs, the largest
/// agreement wins and is refitted.
/// @return  nullopt when fewer than two agree to `threshold_rad` in front of their cameras under at
///          least `min_angle_rad` of parallax, or when they are not the majority.
std::optional<RobustPoint> TriangulateRobustly(const std::vector<Sighting>& sightings,
                                               double min_angle_rad,
                                               double threshold_rad);

}  // namespace rotslam
