#pragma once

#include <optional>

#include <Eigen/Core>
#include <ceres/cost_function.h>
#include <ceres/sized_cost_function.h>

#include "ba/lens.h"
#include "rotodom/camera/camera.h"

namespace rotslam {

/// What a pixel does when the pose or the point moves by a little.
struct ReprojectionJacobian {
  Eigen::Matrix<double, 2, 3> by_rotation;  // px per rad of delta, Exp(delta) * cam_from_world
  Eigen::Matrix<double, 2, 3> by_center;    // px per world unit
  Eigen::Matrix<double, 2, 3> by_point;     // px per world unit
};

/// Pixel at which a camera sees a point; nullopt where the camera model does not reach.
/// @param R_c_w  cam_from_world as a matrix.
/// @param J      when given, receives the derivatives.
/// Error: J equals central differences to 1e-6 of its size, for every camera model (ba tests).
std::optional<Eigen::Vector2d> Reproject(const Camera& camera,
                                         const Eigen::Matrix3d& R_c_w,
                                         const Eigen::Vector3d& center_in_world,
                                         const Eigen::Vector3d& point_in_world,
                                         ReprojectionJacobian* J = nullptr);

/// Residual of a point the model cannot project (behind the camera, beyond the fold), per axis and
/// in pixels, with zero derivative: a step that pushes a few bad points behind a camera costs
/// something but is not refused for their sake, and they fall at the next classification.
inline constexpr double kUnseenResidual_px = 1e3;

/// Which parameter blocks an observation has, in this order.
struct ObservationForm {
  // The pose as one block of seven (PoseManifold), or quaternion (4) and centre (3) apart, so that
  // frames can share a centre.
  bool joint_pose = true;
  // The point (3) lies in a direction of any length, without depth: the centre does not count, and
  // has no block where poses come apart. Such tracks are seen from one place only, but tell how the
  // camera turned.
  bool at_infinity = false;
  // LensParameters (6) come last.
  bool moves_lens = false;
};

/// (Project(R_c_w (point - center)) - keypoint_px) / sigma_px. Quaternions are used as q / |q|.
class ReprojectionCost final : public ceres::CostFunction {
 public:
  /// @param camera  must outlive the cost function; where the lens moves, the calibrated one.
  ReprojectionCost(const Camera& camera,
                   const Eigen::Vector2d& keypoint_px,
                   double sigma_px,
                   const ObservationForm& form = {});
  bool Evaluate(double const* const* parameters,
                double* residuals,
                double** jacobians) const override;

 private:
  const Camera& camera_;
  Eigen::Vector2d keypoint_px_;
  double sigma_px_;
  ObservationForm form_;
};

/// weight * (direction . (center - origin) / length - 1): keeps one coordinate of one centre, and
/// with it the scale of everything. Scale is free otherwise, so the residual is zero at the optimum
/// and moves nothing there; unlike a smaller parameter block it leaves all camera blocks the same
/// size, which is what Ceres' specialised Schur elimination asks for.
class ScaleAnchorCost final : public ceres::CostFunction {
 public:
  /// @param joint_pose  the block is a pose of seven, not a centre.
  ScaleAnchorCost(const Eigen::Vector3d& origin,
                  const Eigen::Vector3d& start_center,
                  double weight,
                  bool joint_pose);
  bool Evaluate(double const* const* parameters,
                double* residuals,
                double** jacobians) const override;

 private:
  Eigen::Vector3d origin_;
  Eigen::Vector3d scaled_direction_;  // direction / length
  double weight_;
  int offset_;  // of the centre in its block
};

}  // namespace rotslam
