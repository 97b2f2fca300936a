#include "ba/pose_manifold.h"

#include <algorithm>

#include <Eigen/Geometry>

#include "ba/quaternion_jacobian.h"
#include "rotodom/types/rotation.h"

namespace rotslam {
namespace {

template <int Rows, int Cols>
using RowMajor = Eigen::Matrix<double, Rows, Cols, Eigen::RowMajor>;

// The numbers at `data` as a matrix to write to.
template <int Rows, int Cols>
Eigen::Map<RowMajor<Rows, Cols>> As(double* data) {
  return Eigen::Map<RowMajor<Rows, Cols>>(data);
}

}  // namespace

bool LeftRotationManifold::Plus(const double* x, const double* delta, double* x_plus_delta) const {
  const Eigen::Map<const Eigen::Quaterniond> q(x);
  const Eigen::Map<const Eigen::Vector3d> rotation_vector(delta);
  if (!rotation_vector.allFinite()) return false;
  Eigen::Map<Eigen::Quaterniond> result(x_plus_delta);
  result = (Rotation::Exp(rotation_vector).Quaternion() * q).normalized();
  return true;
}

bool LeftRotationManifold::PlusJacobian(const double* x, double* jacobian) const {
  As<4, 3>(jacobian) = LeftJacobian(Eigen::Map<const Eigen::Quaterniond>(x));
  return true;
}

bool LeftRotationManifold::Minus(const double* y, const double* x, double* y_minus_x) const {
  const Eigen::Map<const Eigen::Quaterniond> q_y(y);
  const Eigen::Map<const Eigen::Quaterniond> q_x(x);
  Eigen::Map<Eigen::Vector3d> difference(y_minus_x);
  difference = Rotation(q_y * q_x.conjugate()).Log();
  return true;
}

bool LeftRotationManifold::MinusJacobian(const double* x, double* jacobian) const {
  As<3, 4>(jacobian) = LeftInverseJacobian(Eigen::Map<const Eigen::Quaterniond>(x));
  return true;
}

bool PoseManifold::Plus(const double* x, const double* delta, double* x_plus_delta) const {
  for (int k = 0; k < 3; ++k) x_plus_delta[4 + k] = x[4 + k] + delta[3 + k];
  return rotation_.Plus(x, delta, x_plus_delta);
}

bool PoseManifold::PlusJacobian(const double* x, double* jacobian) const {
  auto J = As<7, 6>(jacobian);
  J.setZero();
  J.topLeftCorner<4, 3>() = LeftJacobian(Eigen::Map<const Eigen::Quaterniond>(x));
  J.bottomRightCorner<3, 3>().setIdentity();
  return true;
}

bool PoseManifold::Minus(const double* y, const double* x, double* y_minus_x) const {
  for (int k = 0; k < 3; ++k) y_minus_x[3 + k] = y[4 + k] - x[4 + k];
  return rotation_.Minus(y, x, y_minus_x);
}

bool PoseManifold::MinusJacobian(const double* x, double* jacobian) const {
  auto J = As<6, 7>(jacobian);
  J.setZero();
  J.topLeftCorner<3, 4>() = LeftInverseJacobian(Eigen::Map<const Eigen::Quaterniond>(x));
  J.bottomRightCorner<3, 3>().setIdentity();
  return true;
}

bool CenterManifold::Plus(const double* x, const double* delta, double* x_plus_delta) const {
  std::copy_n(x, 4, x_plus_delta);
  for (int k = 0; k < 3; ++k) x_plus_delta[4 + k] = x[4 + k] + delta[k];
  return true;
}

bool CenterManifold::PlusJacobian(const double* /*x*/, double* jacobian) const {
  auto J = As<7, 3>(jacobian);
  J.setZero();
  J.bottomRows<3>().setIdentity();
  return true;
}

bool CenterManifold::Minus(const double* y, const double* x, double* y_minus_x) const {
  for (int k = 0; k < 3; ++k) y_minus_x[k] = y[4 + k] - x[4 + k];
  return true;
}

bool CenterManifold::MinusJacobian(const double* /*x*/, double* jacobian) const {
  auto J = As<3, 7>(jacobian);
  J.setZero();
  J.rightCols<3>().setIdentity();
  return true;
}

}  // namespace rotslam
