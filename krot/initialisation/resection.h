#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

namespace rotslam {

/// A known point and the direction in which the view sees it.
struct RayToPoint {
  Eigen::Vector3d point_in_world;
  Eigen::Vector3d ray_in_world;  // unit, from the unknown centre
};

// Not ba's ResectionOptions: both live in namespace rotslam, where a name has one meaning.
/// Of one camera centre from known points.
struct CenterResectionOptions {
  double threshold_rad = 0.0057;  // inlier angle; 4 px at f = 700
  int max_samples = 200;
  std::uint64_t seed = 1;
};

struct Resection {
  Eigen::Vector3d center_in_world;
  std::vector<int> inliers;  // positions in the input
};

/// Camera centre from known points seen under a known rotation: the centre lies on the line through
/// each point along its ray, d x (X - c) = 0, linear in c. Pairs of lines drawn at random propose,
/// all lines vote, robust least squares on the sphere finishes.
/// @return  nullopt when fewer than three lines agree or they leave the centre open.
/// Error:   exact on exact input (1e-9 of the scene's size).
std::optional<Resection> ResectCenter(const std::vector<RayToPoint>& rays,
                                      const CenterResectionOptions& options);

}  // namespace rotslam
