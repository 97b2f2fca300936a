#pragma once

#include <vector>

#include <Eigen/Core>

namespace rotslam {

/// The box of instant-ngp: a position p of the world comes to `scale * p + offset`, and the scene
/// lies within aabb_scale / 2 of (1/2, 1/2, 1/2) along each axis.
struct SceneBox {
  double scale = 1.0;
  Eigen::Vector3d offset = Eigen::Vector3d::Constant(0.5);
  int aabb_scale = 1;   // a power of two, at most 128
  int num_outside = 0;  // points that do not fit in the largest box
};

/// The smallest box that holds all cameras and points, with the cameras and the nearer half of the
/// points in the unit cube. Where the largest box cannot hold all, one point in a hundred may stay
/// outside, and then the scale is smaller.
SceneBox ChooseSceneBox(const std::vector<Eigen::Vector3d>& centers,
                        const std::vector<Eigen::Vector3d>& points);

}  // namespace rotslam
