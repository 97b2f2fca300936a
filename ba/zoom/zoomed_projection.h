#pragma once

#include <cmath>
#include <optional>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "rotodom/camera/camera.h"
#include "rotodom/types/rotation.h"

namespace rotslam {

/// The pose of a frame and its focal length.
struct ZoomedPose {
  Rotation cam_from_world;
  Eigen::Vector3d center_in_world = Eigen::Vector3d::Zero();
  double log_scale = 0.0;  // natural logarithm of its focal length over the camera's
};

/// Derivatives of the pixel of a zoomed camera.
struct ZoomedJacobian {
  Eigen::Matrix<double, 2, 3> by_turn;   // delta of Exp(delta) * cam_from_world
  Eigen::Matrix<double, 2, 3> by_point;  // by the centre the same with the other sign
  Eigen::Vector2d by_log_scale;
};

/// The pixel that shows a point in a zoomed camera: the scale moves it away from the principal
/// point. nullopt where the camera model does not reach.
/// @param J  when given, receives the derivatives.
inline std::optional<Eigen::Vector2d> ProjectZoomed(const Camera& camera,
                                                    const ZoomedPose& pose,
                                                    const Eigen::Vector3d& point_in_world,
                                                    ZoomedJacobian* J = nullptr) {
  const Eigen::Matrix3d R_c_w = pose.cam_from_world.Matrix();
  const Eigen::Vector3d in_cam = R_c_w * (point_in_world - pose.center_in_world);
  Eigen::Matrix<double, 2, 3> by_in_cam;
  const auto pixel = camera.Project(in_cam, &by_in_cam);
  if (!pixel) return std::nullopt;
  const double scale = std::exp(pose.log_scale);
  const Eigen::Vector2d principal_point(camera.cx, camera.cy);
  const Eigen::Vector2d offset = scale * (*pixel - principal_point);
  if (J != nullptr) {
    for (int axis = 0; axis < 3; ++axis) {
      J->by_turn.col(axis) = scale * by_in_cam * Eigen::Vector3d::Unit(axis).cross(in_cam);
    }
    J->by_point = scale * by_in_cam * R_c_w;
    J->by_log_scale = offset;
  }
  return principal_point + offset;
}

}  // namespace rotslam
