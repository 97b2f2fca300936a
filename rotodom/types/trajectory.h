#pragma once

#include <vector>

#include <Eigen/Core>

#include "rotodom/types/rotation.h"

namespace rotslam {

/// A camera pose at a time, camera->world as trajectory files have it.
struct StampedPose {
  double timestamp_s = 0.0;
  Rotation world_from_cam;
  Eigen::Vector3d center_in_world = Eigen::Vector3d::Zero();
};

using Trajectory = std::vector<StampedPose>;  // timestamps ascending

}  // namespace rotslam
