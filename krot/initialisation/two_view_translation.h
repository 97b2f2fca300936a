#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

namespace rotslam {

/// The directions in which two views of known rotation see one point; unit, in world axes.
struct RayPair {
  Eigen::Vector3d ray_a_in_world;
  Eigen::Vector3d ray_b_in_world;
};

/// Of the direction between two camera centres.
struct TwoViewTranslationOptions {
  // Angle between a ray and the epipolar plane up to which a pair agrees; 4 px at f = 700. Pairs
  // with less parallax than this have no say in the sign.
  double threshold_rad = 0.0057;
  int max_samples = 200;  // of two pairs each
  int min_inliers = 8;
  std::uint64_t seed = 1;
};

struct TwoViewTranslation {
  Eigen::Vector3d direction_in_world;  // unit, from centre a to centre b
  std::vector<int> inliers;            // positions in the input, points behind a view among them
  double front_ratio;                  // inliers with parallax that lie in front of both views
};

/// Direction of the translation between two views from their rotations: two pairs propose, all
/// vote by their angle to the epipolar plane, least squares on the inliers finishes, and the points
/// decide the sign by lying in front.
/// @return  nullopt with fewer than min_inliers, and where no inlier has parallax: a view that only
///          turned.
/// Error:   1e-9 on exact rays.
/// Cost:    max_samples passes over the pairs.
std::optional<TwoViewTranslation> EstimateTwoViewTranslation(
    const std::vector<RayPair>& pairs, const TwoViewTranslationOptions& options = {});

}  // namespace rotslam
