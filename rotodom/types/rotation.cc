#include "rotodom/types/rotation.h"

#include <cmath>
#include <stdexcept>

#include <Eigen/SVD>

namespace rotslam {
namespace {

Eigen::Quaterniond Canonical(Eigen::Quaterniond q) {
  q.normalize();
  if (q.w() < 0.0) q.coeffs() = -q.coeffs();
  return q;
}

}  // namespace

Eigen::Matrix3d Skew(const Eigen::Vector3d& a) {
  Eigen::Matrix3d S;
  S << 0.0, -a.z(), a.y(), a.z(), 0.0, -a.x(), -a.y(), a.x(), 0.0;
  return S;
}

Rotation::Rotation(const Eigen::Quaterniond& q) {
  if (!q.coeffs().allFinite() || q.norm() < 1e-12) {
    throw std::invalid_argument("Rotation: quaternion is zero or not finite");
  }
  q_ = Canonical(q);
}

Rotation Rotation::FromMatrix(const Eigen::Matrix3d& R) {
  if (!R.allFinite()) throw std::invalid_argument("Rotation: matrix is not finite");
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(R, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Matrix3d nearest = svd.matrixU() * svd.matrixV().transpose();
  if (nearest.determinant() < 0.0 || (nearest - R).norm() > 1e-3) {
    throw std::invalid_argument("Rotation: matrix is not a rotation");
  }
  return Rotation(Eigen::Quaterniond(nearest));
}

Rotation Rotation::Exp(const Eigen::Vector3d& rotation_vector) {
  const double angle = rotation_vector.norm();
  const double half = 0.5 * angle;
  // sin(angle / 2) / angle, by its series near zero.
  const double scale = angle > 1e-6 ? std::sin(half) / angle : 0.5 - angle * angle / 48.0;
  Eigen::Quaterniond q;
  q.w() = std::cos(half);
  q.vec() = scale * rotation_vector;
  return Rotation(q);
}

Eigen::Vector3d Rotation::Log() const {
  const double sine = q_.vec().norm();
  if (sine < 1e-9) return 2.0 * q_.vec();
  return (2.0 * std::atan2(sine, q_.w()) / sine) * q_.vec();
}

double Rotation::Angle() const { return 2.0 * std::atan2(q_.vec().norm(), q_.w()); }

Rotation Rotation::Inverse() const {
  Rotation inverse;
  inverse.q_ = q_.conjugate();
  return inverse;
}

Rotation Rotation::operator*(const Rotation& other) const {
  Rotation product;
  product.q_ = Canonical(q_ * other.q_);
  return product;
}

Rotation Interpolate(const Rotation& a, const Rotation& b, double weight) {
  return a * Rotation::Exp(weight * (a.Inverse() * b).Log());
}

}  // namespace rotslam
