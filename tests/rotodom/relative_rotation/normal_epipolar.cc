#include "tests/rotodom/relative_rotation/normal_epipolar.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Dense>

namespace rotslam {
namespace {

using Matrix9 = Eigen::Matrix<double, 9, 9>;
using Matrix93 = Eigen::Matrix<double, 9, 3>;
using Vector9 = Eigen::Matrix<double, 9, 1>;

Vector9 Vec(const Eigen::Matrix3d& A) { return Eigen::Map<const Vector9>(A.data()); }

// vec([t]x R) = EssentialFromTranslation(R) * t.
Matrix93 EssentialFromTranslation(const Eigen::Matrix3d& R) {
  Matrix93 B;
  for (int k = 0; k < 3; ++k) B.col(k) = Vec(Skew(Eigen::Vector3d::Unit(k)) * R);
  return B;
}

struct Evaluation {
  Matrix93 B;
  Eigen::Vector3d direction;
  double value;
};

Evaluation Evaluate(const Matrix9& S, const Rotation& j_from_i) {
  Evaluation result;
  result.B = EssentialFromTranslation(j_from_i.Matrix());
  const Eigen::Matrix3d M = result.B.transpose() * S * result.B;
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(M);
  result.direction = eigen.eigenvectors().col(0);
  result.value = eigen.eigenvalues()[0];
  return result;
}

}  // namespace

void NormalEpipolarSums::Add(const BearingPair& pair, double weight) {
  Vector9 q;
  for (int column = 0; column < 3; ++column)
    q.segment<3>(3 * column) = pair.bearing_i[column] * pair.bearing_j;
  S_.noalias() += weight * q * q.transpose();
}

NormalEpipolarMinimum MinimiseNormalEpipolar(const NormalEpipolarSums& sums,
                                             const Rotation& start_j_from_i,
                                             int max_iterations) {
  const Matrix9& S = sums.S();
  Rotation j_from_i = start_j_from_i;
  Evaluation current = Evaluate(S, j_from_i);
  double damping = 1e-3;
  for (int iteration = 0; iteration < max_iterations; ++iteration) {
    const Eigen::Matrix3d R_j_i = j_from_i.Matrix();
    Matrix93 J_rotation;
    for (int k = 0; k < 3; ++k) {
      J_rotation.col(k) = Vec(Skew(current.direction) * Skew(Eigen::Vector3d::Unit(k)) * R_j_i);
    }
    const Eigen::Matrix<double, 9, 2> J_direction = current.B * TangentBasis(current.direction);
    const Matrix93 S_J = S * J_rotation;
    const Eigen::Matrix<double, 3, 2> H_rt = S_J.transpose() * J_direction;
    Eigen::Matrix2d H_tt = J_direction.transpose() * S * J_direction;
    H_tt.diagonal().array() += 1e-9 * H_tt.trace() + 1e-300;
    const Eigen::Vector3d gradient = S_J.transpose() * (current.B * current.direction);
    const Eigen::Matrix3d H =
        J_rotation.transpose() * S_J - H_rt * H_tt.inverse() * H_rt.transpose();

    bool improved = false;
    double step_length = 0.0;
    while (!improved && damping < 1e6) {
      Eigen::Matrix3d damped = H;
      damped.diagonal().array() += damping * H.trace() / 3.0 + 1e-300;
      const Eigen::Vector3d step = -damped.ldlt().solve(gradient);
      if (!step.allFinite()) break;
      const Rotation candidate = Rotation::Exp(step) * j_from_i;
      const Evaluation next = Evaluate(S, candidate);
      if (next.value < current.value) {
        improved = true;
        step_length = step.norm();
        j_from_i = candidate;
        current = next;
        damping = std::max(damping * 0.1, 1e-9);
      } else {
        damping *= 10.0;
      }
    }
    if (!improved || step_length < 1e-9) break;
  }
  return {j_from_i, current.direction, current.value};
}

}  // namespace rotslam
