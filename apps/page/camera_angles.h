#pragma once

#include <vector>

#include <Eigen/Core>

#include "rotodom/types/rotation.h"

namespace rotslam {

/// Yaw, pitch and roll of a camera against the world: world_from_cam = Ry(yaw) Rx(pitch) Rz(roll).
/// Seen by the camera's axes (x right, y down, z forward) yaw turns right, pitch up, roll
/// clockwise.
/// @param before_deg  angles that came before, which the result is as close as possible to by
///                    multiples of 360 deg; null: none.
/// @return  roll, pitch, yaw in degrees.
Eigen::Vector3d RollPitchYawDeg(const Rotation& world_from_cam, const Eigen::Vector3d* before_deg);

/// The same for each orientation of a sequence.
std::vector<Eigen::Vector3d> RollPitchYawDeg(const std::vector<Rotation>& world_from_cam);

}  // namespace rotslam
