#pragma once

#include <optional>

#include <Eigen/Core>

#include "rotodom/camera/camera.h"
#include "rotodom/features/features.h"

namespace rotslam {

/// What a keypoint sees, as if its row had been exposed in the middle of the frame; with a global
/// shutter (camera.readout_s is 0) its bearing.
/// @param rate           of the camera's rotation, rad/s in camera axes.
/// @param flow_px_per_s  motion of the keypoint beside that.
/// @return  unit, in the camera frame; nullopt where the camera model has no bearing.
std::optional<Eigen::Vector3d> BearingInMidFrame(
    const Eigen::Vector2d& keypoint_px,
    const Camera& camera,
    const Eigen::Vector3d& rate,
    const Eigen::Vector2d& flow_px_per_s = Eigen::Vector2d::Zero());

/// Moves corners to where they would be had their rows been exposed in the middle of the frame;
/// those without a bearing stay.
/// @param rate  as above.
void MoveToMidFrame(const Camera& camera, const Eigen::Vector3d& rate, Features& corners);

}  // namespace rotslam
