#include "ba/reprojection_cost.h"

#include <cmath>

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

// d(pixel) / d(lens) at a point that the camera sees at `pixel`, the share of the focal length
// being one.
Eigen::Matrix<double, 2, 3> LensJacobian(const Camera& camera,
                                         const Eigen::Vector3d& point_in_cam,
                                         const Eigen::Vector2d& pixel) {
  // The distortion's radius and its direction: x (1 + k1 r^2 + k2 r^4) and likewise y.
  const double r = point_in_cam.head<2>().norm();
  Eigen::Vector2d axis = point_in_cam.head<2>() / point_in_cam.z();
  double radius = axis.norm();
  if (camera.model == CameraModel::kEquidistant) {
    radius = std::atan2(r, point_in_cam.z());
    axis = r > 0.0 ? Eigen::Vector2d(radius / r * point_in_cam.head<2>()) : Eigen::Vector2d::Zero();
  }
  const double s = radius * radius;
  const Eigen::Vector2d by_radius(camera.fx * axis.x(), camera.fy * axis.y());
  Eigen::Matrix<double, 2, 3> J;
  J.col(0) = pixel - Eigen::Vector2d(camera.cx, camera.cy);
  J.col(1) = s * by_radius;
  J.col(2) = s * s * by_radius;
  return J;
}

// Where an observation's blocks lie; null where it has no such block.
struct ReprojectionBlocks {
  const double* quaternion;
  const double* center;
  const double* point;
  double* J_quaternion = nullptr;
  double* J_center = nullptr;
  double* J_point = nullptr;
  double* J_lens = nullptr;
};

// @param lens_scale  share of the focal length that `camera` has of the one given.
void EvaluateReprojection(const Camera& camera,
                          double lens_scale,
                          const Eigen::Vector2d& keypoint_px,
                          double sigma_px,
                          const ReprojectionBlocks& blocks,
                          double* residuals) {
  const Eigen::Quaterniond q(blocks.quaternion);
  const double weight = 1.0 / sigma_px;
  const bool wants_jacobian = blocks.J_quaternion != nullptr || blocks.J_center != nullptr ||
                              blocks.J_point != nullptr || blocks.J_lens != nullptr;
  ReprojectionJacobian J;
  const std::optional<Eigen::Vector2d> pixel =
      Reproject(camera,
                q.normalized().toRotationMatrix(),
                Eigen::Map<const Eigen::Vector3d>(blocks.center),
                Eigen::Map<const Eigen::Vector3d>(blocks.point),
                wants_jacobian ? &J : nullptr);
  if (!pixel) {
    J.by_rotation.setZero();
    J.by_center.setZero();
    J.by_point.setZero();
    J.by_lens.setZero();
  }
  Eigen::Map<Eigen::Vector2d> residual(residuals);
  residual = pixel ? Eigen::Vector2d(weight * (*pixel - keypoint_px))
                   : Eigen::Vector2d::Constant(weight * kUnseenResidual_px);
  if (blocks.J_quaternion != nullptr) {
    As<RowMatrix24>(blocks.J_quaternion) = weight * J.by_rotation * LeftInverseJacobian(q);
  }
  if (blocks.J_center != nullptr) As<RowMatrix23>(blocks.J_center) = weight * J.by_center;
  if (blocks.J_point != nullptr) As<RowMatrix23>(blocks.J_point) = weight * J.by_point;
  if (blocks.J_lens != nullptr) {
    J.by_lens.col(0) /= lens_scale;
    As<RowMatrix23>(blocks.J_lens) = weight * J.by_lens;
  }
}

constexpr double kOrigin[3] = {0.0, 0.0, 0.0};

double* JacobianOf(double** jacobians, int block) {
  return jacobians == nullptr ? nullptr : jacobians[block];
}

}  // namespace

LensParameters LensOf(const Camera& camera, const Camera& calibrated) {
  return {camera.fx / calibrated.fx, camera.distortion[0], camera.distortion[1]};
}

Camera WithLens(const Camera& camera, const LensParameters& lens) {
  Camera result = camera;
  result.fx *= lens[0];
  result.fy *= lens[0];
  result.distortion[0] = lens[1];
  result.distortion[1] = lens[2];
  const bool bends = lens[1] != 0.0 || lens[2] != 0.0;
  if (bends && camera.model == CameraModel::kPinhole) result.model = CameraModel::kRadtan;
  return result;
}

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
  J->by_lens = LensJacobian(camera, point_in_cam, *pixel);
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
  EvaluateReprojection(camera_,
                       1.0,
                       keypoint_px_,
                       sigma_px_,
                       {parameters[0],
                        parameters[1],
                        parameters[2],
                        JacobianOf(jacobians, 0),
                        JacobianOf(jacobians, 1),
                        JacobianOf(jacobians, 2)},
                       residuals);
  return true;
}

bool DirectionCost::Evaluate(double const* const* parameters,
                             double* residuals,
                             double** jacobians) const {
  EvaluateReprojection(camera_,
                       1.0,
                       keypoint_px_,
                       sigma_px_,
                       {parameters[0],
                        kOrigin,
                        parameters[1],
                        JacobianOf(jacobians, 0),
                        nullptr,
                        JacobianOf(jacobians, 1)},
                       residuals);
  return true;
}

bool LensReprojectionCost::Evaluate(double const* const* parameters,
                                    double* residuals,
                                    double** jacobians) const {
  const Eigen::Map<const LensParameters> lens(parameters[3]);
  EvaluateReprojection(WithLens(camera_, lens),
                       lens[0],
                       keypoint_px_,
                       sigma_px_,
                       {parameters[0],
                        parameters[1],
                        parameters[2],
                        JacobianOf(jacobians, 0),
                        JacobianOf(jacobians, 1),
                        JacobianOf(jacobians, 2),
                        JacobianOf(jacobians, 3)},
                       residuals);
  return true;
}

bool LensDirectionCost::Evaluate(double const* const* parameters,
                                 double* residuals,
                                 double** jacobians) const {
  const Eigen::Map<const LensParameters> lens(parameters[2]);
  EvaluateReprojection(WithLens(camera_, lens),
                       lens[0],
                       keypoint_px_,
                       sigma_px_,
                       {parameters[0],
                        kOrigin,
                        parameters[1],
                        JacobianOf(jacobians, 0),
                        nullptr,
                        JacobianOf(jacobians, 1),
                        JacobianOf(jacobians, 2)},
                       residuals);
  return true;
}

bool LensPriorCost::Evaluate(double const* const* parameters,
                             double* residuals,
                             double** jacobians) const {
  const Eigen::Map<const LensParameters> lens(parameters[0]);
  Eigen::Map<LensParameters> residual(residuals);
  residual = (lens - expected_).cwiseQuotient(sigmas_);
  if (jacobians != nullptr && jacobians[0] != nullptr) {
    As<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(jacobians[0]) =
        sigmas_.cwiseInverse().asDiagonal();
  }
  return true;
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
