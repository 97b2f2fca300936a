#pragma once

#include <Eigen/Geometry>

namespace rotslam {

// d (Exp(delta) * q) / d delta at zero, for q = (x, y, z, w) of any length: half the quaternion
// product (delta, 0) * q.
inline Eigen::Matrix<double, 4, 3> LeftJacobian(const Eigen::Quaterniond& q) {
  Eigen::Matrix<double, 4, 3> J;
  J << q.w(), q.z(), -q.y(),  //
      -q.z(), q.w(), q.x(),   //
      q.y(), -q.x(), q.w(),   //
      -q.x(), -q.y(), -q.z();
  return 0.5 * J;
}

// Its columns are orthogonal, of length |q| / 2, so this is its pseudo-inverse; it is also the
// derivative of delta by the quaternion that is normalised before use.
inline Eigen::Matrix<double, 3, 4> LeftInverseJacobian(const Eigen::Quaterniond& q) {
  return (4.0 / q.squaredNorm()) * LeftJacobian(q).transpose();
}

}  // namespace rotslam
