#include "apps/page/camera_angles.h"

#include <algorithm>
#include <cmath>

namespace rotslam {

Eigen::Vector3d RollPitchYawDeg(const Rotation& world_from_cam, const Eigen::Vector3d* before_deg) {
  const Eigen::Matrix3d R_w_c = world_from_cam.Matrix();
  Eigen::Vector3d angle_deg =
      kDegFromRad * Eigen::Vector3d(std::atan2(R_w_c(1, 0), R_w_c(1, 1)),
                                    std::asin(std::clamp(-R_w_c(1, 2), -1.0, 1.0)),
                                    std::atan2(R_w_c(0, 2), R_w_c(2, 2)));
  if (before_deg == nullptr) return angle_deg;
  for (int axis = 0; axis < 3; ++axis) {
    angle_deg[axis] -= 360.0 * std::round((angle_deg[axis] - (*before_deg)[axis]) / 360.0);
  }
  return angle_deg;
}

std::vector<Eigen::Vector3d> RollPitchYawDeg(const std::vector<Rotation>& world_from_cam) {
  std::vector<Eigen::Vector3d> angles_deg;
  angles_deg.reserve(world_from_cam.size());
  for (const Rotation& rotation : world_from_cam) {
    angles_deg.push_back(
        RollPitchYawDeg(rotation, angles_deg.empty() ? nullptr : &angles_deg.back()));
  }
  return angles_deg;
}

}  // namespace rotslam
