#include "ba/reprojection_cost.h"

#include <Eigen/Geometry>

#include "rotodom/types/rotation.h"

namespace rotslam {
namespace {

using RowMatrix23 = Eigen::Matrix<double, 2, 3, Eigen::RowMajor>;
using RowMatrix24 = Eigen::Matrix<double, 2, 4, Eigen::RowMajor>;
using Matrix43 = Eigen::Matrix<double, 4, 3>;
using RowMatrix43 = Eigen::Matrix<double, 4, 3, Eigen::RowMajor>;
using RowMatrix34 = Eigen::Matrix<double, 3, 4, Eigen::RowMajor>;

// The numbers at `data` as a matrix to write to.
template <class Matrix>
Eigen::Map<Matrix> As(double* data) {
  return Eigen::Map<Matrix>(data);
}

// d (Exp(delta) * q) / d delta at zero, for q = (x, y, z, w) of any length: half the quaternion
// product (delta, 0) * q.
Matrix43 LeftJacobian(const Eigen::Quaterniond& q) {
  Matrix43 J;
  J << q.w(), q.z(), -q.y(),  //
      -q.z(), q.w(), q.x(),   //
      q.y(), -q.x(), q.w(),   //
      -q.x(), -q.y(), -q.z();
  return 0.5 * J;
}

// Its columns are orthogonal, of length |q| / 2, so this is its pseudo-inverse; it is also the
// derivative of delta by the quaternion that is normalised before use.
Eigen::Matrix<double, 3, 4> LeftInverseJacobian(const Eigen::Quaterniond& q) {
  return (4.0 / q.squaredNorm()) * LeftJacobian(q).transpose();
}

}  // namespace

std::optional<Eigen::Vector2d> Reproject(const Camera& camera,
                                         const Eigen::Matrix3d& R_c_w,
                                         const Eigen::Vector3d& center_in_world,
                                         const Eigen::Vector3d& point_in_world,
                                         ReprojectionJacobian* J) {
  const Eigen::Vector3d point_in_cam = R_c_w * (point_in_world - center_in_world);
  if (J == nullptr) return camera.Project(point_in_cam);
  Eigen::Matrix<double, 2, 3> J_project;
  std::optional<Eigen::Vector2d> pixel = camera.Project(point_in_cam, &J_project);
  if (!pixel) return std::nullopt;
  // Exp(delta) p = p + delta x p, to first order.
  J->by_rotation.noalias() = -J_project * Skew(point_in_cam);
  J->by_point.noalias() = J_project * R_c_w;
  J->by_center = -J->by_point;
  return pixel;
}

bool LeftRotationManifold::Plus(const double* x, const double* delta, double* x_plus_delta) const {
  const Eigen::Map<const Eigen::Quaterniond> q(x);
  const Eigen::Map<const Eigen::Vector3d> rotation_vector(delta);
  if (!rotation_vector.allFinite()) return false;
  Eigen::Map<Eigen::Quaterniond> result(x_plus_delta);
  result = (Rotation::Exp(rotation_vector).Quaternion() * q).normalized();
  return true;
}

bool LeftRotationManifold::PlusJacobian(const double* x, double* jacobian) const {
  As<RowMatrix43>(jacobian) = LeftJacobian(Eigen::Map<const Eigen::Quaterniond>(x));
  return true;
}

bool LeftRotationManifold::Minus(const double* y, const double* x, double* y_minus_x) const {
  const Eigen::Map<const Eigen::Quaterniond> q_y(y);
  const Eigen::Map<const Eigen::Quaterniond> q_x(x);
  As<Eigen::Vector3d>(y_minus_x) = Rotation(q_y * q_x.conjugate()).Log();
  return true;
}

bool LeftRotationManifold::MinusJacobian(const double* x, double* jacobian) const {
  As<RowMatrix34>(jacobian) = LeftInverseJacobian(Eigen::Map<const Eigen::Quaterniond>(x));
  return true;
}

bool ReprojectionCost::Evaluate(double const* const* parameters,
                                double* residuals,
                                double** jacobians) const {
  const Eigen::Quaterniond q(parameters[0]);
  const Eigen::Map<const Eigen::Vector3d> center(parameters[1]);
  const Eigen::Map<const Eigen::Vector3d> point(parameters[2]);
  const double weight = 1.0 / sigma_px_;
  ReprojectionJacobian J;
  const std::optional<Eigen::Vector2d> pixel = Reproject(camera_,
                                                         q.normalized().toRotationMatrix(),
                                                         center,
                                                         point,
                                                         jacobians == nullptr ? nullptr : &J);
  if (!pixel) {
    J.by_rotation.setZero();
    J.by_center.setZero();
    J.by_point.setZero();
  }
  Eigen::Map<Eigen::Vector2d> residual(residuals);
  residual = pixel ? Eigen::Vector2d(weight * (*pixel - keypoint_px_))
                   : Eigen::Vector2d::Constant(weight * kUnseenResidual_px);
  if (jacobians == nullptr) return true;
  if (jacobians[0] != nullptr) {
    As<RowMatrix24>(jacobians[0]) = weight * J.by_rotation * LeftInverseJacobian(q);
  }
  if (jacobians[1] != nullptr) As<RowMatrix23>(jacobians[1]) = weight * J.by_center;
  if (jacobians[2] != nullptr) As<RowMatrix23>(jacobians[2]) = weight * J.by_point;
  return true;
}

bool DirectionCost::Evaluate(double const* const* parameters,
                             double* residuals,
                             double** jacobians) const {
  const double origin[3] = {0.0, 0.0, 0.0};
  const double* const with_origin[3] = {parameters[0], origin, parameters[1]};
  double* with_origin_jacobians[3] = {nullptr, nullptr, nullptr};
  if (jacobians != nullptr) {
    with_origin_jacobians[0] = jacobians[0];
    with_origin_jacobians[2] = jacobians[1];
  }
  return ReprojectionCost(camera_, keypoint_px_, sigma_px_)
      .Evaluate(with_origin, residuals, jacobians == nullptr ? nullptr : with_origin_jacobians);
}

ScaleAnchorCost::ScaleAnchorCost(const Eigen::Vector3d& origin,
                                 const Eigen::Vector3d& start_center,
                                 double weight)
    : origin_(origin),
      scaled_direction_((start_center - origin) / (start_center - origin).squaredNorm()),
      weight_(weight) {}

bool ScaleAnchorCost::Evaluate(double const* const* parameters,
                               double* residuals,
                               double** jacobians) const {
  const Eigen::Map<const Eigen::Vector3d> center(parameters[0]);
  residuals[0] = weight_ * (scaled_direction_.dot(center - origin_) - 1.0);
  if (jacobians != nullptr && jacobians[0] != nullptr) {
    As<Eigen::Vector3d>(jacobians[0]) = weight_ * scaled_direction_;
  }
  return true;
}

}  // namespace rotslam
