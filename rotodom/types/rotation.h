#pragma once

#include <numbers>

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace rotslam {

constexpr double kRadFromDeg = std::numbers::pi / 180.0;
constexpr double kDegFromRad = 180.0 / std::numbers::pi;

/// Skew-symmetric matrix with Skew(a) * b == a x b.
Eigen::Matrix3d Skew(const Eigen::Vector3d& a);

/// A rotation in 3-D; always a unit quaternion, renormalised after every product.
///
/// Conventions, valid everywhere in rotslam:
/// - `b_from_a * point_in_a = point_in_b`; inner names meet and cancel: `c_from_b * b_from_a =
/// c_from_a`.
/// - Files and `Quaternion().coeffs()` store (x, y, z, w); Eigen's constructor takes (w, x, y, z).
/// - Small changes are composed on the left: `Rotation::Exp(delta) * b_from_a`, delta living in
/// frame b.
class Rotation {
 public:
  Rotation() = default;  // identity
  /// Normalises `q`; throws std::invalid_argument when it is zero or not finite.
  explicit Rotation(const Eigen::Quaterniond& q);
  /// Nearest rotation to `R`; throws std::invalid_argument when `R` is not finite or not near a
  /// rotation (1e-3).
  static Rotation FromMatrix(const Eigen::Matrix3d& R);
  /// Rotation about `rotation_vector` (radians) by its length.
  static Rotation Exp(const Eigen::Vector3d& rotation_vector);

  /// Rotation vector, length in [0, pi].
  Eigen::Vector3d Log() const;
  /// Rotation angle in radians, in [0, pi].
  double Angle() const;
  double AngleDeg() const { return Angle() * kDegFromRad; }

  Rotation Inverse() const;
  Eigen::Matrix3d Matrix() const { return q_.toRotationMatrix(); }
  /// Unit quaternion with w >= 0.
  const Eigen::Quaterniond& Quaternion() const { return q_; }

  Rotation operator*(const Rotation& other) const;
  Eigen::Vector3d operator*(const Eigen::Vector3d& point) const { return q_ * point; }

 private:
  Eigen::Quaterniond q_ = Eigen::Quaterniond::Identity();
};

/// Spherical linear interpolation: `a` at weight 0, `b` at weight 1.
Rotation Interpolate(const Rotation& a, const Rotation& b, double weight);

}  // namespace rotslam
