#pragma once

#include <Eigen/Core>
#include <ceres/manifold.h>
#include <ceres/sized_cost_function.h>

#include "rotodom/camera/camera.h"

namespace rotslam {

/// What a pixel does when the pose or the point moves by a little.
struct ReprojectionJacobian {
  Eigen::Matrix<double, 2, 3> by_rotation;  // px per rad of delta, Exp(delta) * cam_from_world
  Eigen::Matrix<double, 2, 3> by_center;    // px per world unit
  Eigen::Matrix<double, 2, 3> by_point;     // px per world unit
  Eigen::Matrix<double, 2, 3> by_lens;      // px per unit of LensParameters
};

/// What refinement can change about a camera, as one parameter block: its focal length as a share
/// of the one given, and the first two radial coefficients of its distortion.
using LensParameters = Eigen::Vector3d;

LensParameters LensOf(const Camera& camera, const Camera& calibrated);

/// `camera` with that lens; a pinhole that gets a distortion becomes radtan.
Camera WithLens(const Camera& camera, const LensParameters& lens);

/// Pixel at which a camera sees a point; nullopt where the camera model does not reach.
/// @param R_c_w  cam_from_world as a matrix.
/// @param J      when given, receives the derivatives.
/// Error: J equals central differences to 1e-6 of its size, for every camera model (ba tests).
std::optional<Eigen::Vector2d> Reproject(const Camera& camera,
                                         const Eigen::Matrix3d& R_c_w,
                                         const Eigen::Vector3d& center_in_world,
                                         const Eigen::Vector3d& point_in_world,
                                         ReprojectionJacobian* J = nullptr);

/// Unit quaternions (x, y, z, w) of cam_from_world under q -> Exp(delta) * q, delta in radians in
/// the camera frame: the composition side of `Rotation`.
class LeftRotationManifold final : public ceres::Manifold {
 public:
  int AmbientSize() const override { return 4; }
  int TangentSize() const override { return 3; }
  bool Plus(const double* x, const double* delta, double* x_plus_delta) const override;
  bool PlusJacobian(const double* x, double* jacobian) const override;
  bool Minus(const double* y, const double* x, double* y_minus_x) const override;
  bool MinusJacobian(const double* x, double* jacobian) const override;
};

/// Residual of a point the model cannot project (behind the camera, beyond the fold), per axis and
/// in pixels, with zero derivative: a step that pushes a few bad points behind a camera costs
/// something but is not refused for their sake, and they fall at the next classification.
inline constexpr double kUnseenResidual_px = 1e3;

/// (Project(R_c_w (point - center)) - keypoint_px) / sigma_px.
/// Parameters: quaternion of cam_from_world (4, used as q / |q|), centre in the world (3), point in
/// the world (3).
class ReprojectionCost final : public ceres::SizedCostFunction<2, 4, 3, 3> {
 public:
  /// `camera` must outlive the cost function.
  ReprojectionCost(const Camera& camera, const Eigen::Vector2d& keypoint_px, double sigma_px)
      : camera_(camera), keypoint_px_(keypoint_px), sigma_px_(sigma_px) {}
  bool Evaluate(double const* const* parameters,
                double* residuals,
                double** jacobians) const override;

 private:
  const Camera& camera_;
  Eigen::Vector2d keypoint_px_;
  double sigma_px_;
};

/// (Project(R_c_w direction) - keypoint_px) / sigma_px, for tracks seen from one place only: they
/// have no depth, but tell how the camera turned.
/// Parameters: quaternion of cam_from_world (4), direction in the world (3, length free).
class DirectionCost final : public ceres::SizedCostFunction<2, 4, 3> {
 public:
  /// `camera` must outlive the cost function.
  DirectionCost(const Camera& camera, const Eigen::Vector2d& keypoint_px, double sigma_px)
      : camera_(camera), keypoint_px_(keypoint_px), sigma_px_(sigma_px) {}
  bool Evaluate(double const* const* parameters,
                double* residuals,
                double** jacobians) const override;

 private:
  const Camera& camera_;
  Eigen::Vector2d keypoint_px_;
  double sigma_px_;
};

/// The same two with a lens that moves too: LensParameters (3) come last among the parameters.
class LensReprojectionCost final : public ceres::SizedCostFunction<2, 4, 3, 3, 3> {
 public:
  /// `camera`, whose lens is replaced, must outlive the cost function.
  LensReprojectionCost(const Camera& camera, const Eigen::Vector2d& keypoint_px, double sigma_px)
      : camera_(camera), keypoint_px_(keypoint_px), sigma_px_(sigma_px) {}
  bool Evaluate(double const* const* parameters,
                double* residuals,
                double** jacobians) const override;

 private:
  const Camera& camera_;
  Eigen::Vector2d keypoint_px_;
  double sigma_px_;
};

class LensDirectionCost final : public ceres::SizedCostFunction<2, 4, 3, 3> {
 public:
  /// `camera`, whose lens is replaced, must outlive the cost function.
  LensDirectionCost(const Camera& camera, const Eigen::Vector2d& keypoint_px, double sigma_px)
      : camera_(camera), keypoint_px_(keypoint_px), sigma_px_(sigma_px) {}
  bool Evaluate(double const* const* parameters,
                double* residuals,
                double** jacobians) const override;

 private:
  const Camera& camera_;
  Eigen::Vector2d keypoint_px_;
  double sigma_px_;
};

/// (lens - expected) / sigma: what the calibration says.
class LensPriorCost final : public ceres::SizedCostFunction<3, 3> {
 public:
  /// @param sigmas  positive.
  LensPriorCost(const LensParameters& expected, const LensParameters& sigmas)
      : expected_(expected), sigmas_(sigmas) {}
  bool Evaluate(double const* const* parameters,
                double* residuals,
                double** jacobians) const override;

 private:
  LensParameters expected_;
  LensParameters sigmas_;
};

/// weight * (direction . (center - origin) / length - 1): keeps one coordinate of one centre, and
/// with it the scale of everything. Scale is free otherwise, so the residual is zero at the optimum
/// and moves nothing there; unlike a smaller parameter block it leaves all camera blocks the same
/// size, which is what Ceres' specialised Schur elimination asks for.
class ScaleAnchorCost final : public ceres::SizedCostFunction<1, 3> {
 public:
  ScaleAnchorCost(const Eigen::Vector3d& origin,
                  const Eigen::Vector3d& start_center,
                  double weight);
  bool Evaluate(double const* const* parameters,
                double* residuals,
                double** jacobians) const override;

 private:
  Eigen::Vector3d origin_;
  Eigen::Vector3d scaled_direction_;  // direction / length
  double weight_;
};

}  // namespace rotslam
