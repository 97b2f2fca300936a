#include "rotodom/relative_rotation/refinement.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Dense>

#include "rotodom/types/median.h"

namespace rotslam {
namespace {

using Vector5 = Eigen::Matrix<double, 5, 1>;

// Solves the damped normal equations with the direction eliminated. The block of the direction
// vanishes with the baseline, so its damping is relative to its own size.
Vector5 DampedStep(const EpipolarNormal& normal, double damping) {
  constexpr double kTiny = 1e-300;
  Eigen::Matrix3d H_rr = normal.H.topLeftCorner<3, 3>();
  Eigen::Matrix2d H_tt = normal.H.bottomRightCorner<2, 2>();
  H_rr.diagonal().array() += damping * H_rr.trace() / 3.0 + kTiny;
  H_tt.diagonal().array() += damping * H_tt.trace() / 2.0 + kTiny;
  const Eigen::Matrix<double, 3, 2> H_rt = normal.H.topRightCorner<3, 2>();
  const Eigen::Matrix2d H_tt_inverse = H_tt.inverse();
  const Eigen::Matrix<double, 3, 2> eliminate = H_rt * H_tt_inverse;
  const Eigen::Matrix3d H_rotation = H_rr - eliminate * H_rt.transpose();
  const Eigen::Vector3d gradient_r = normal.gradient.head<3>();
  const Eigen::Vector2d gradient_t = normal.gradient.tail<2>();
  Vector5 step;
  step.head<3>() = -(H_rotation.inverse() * (gradient_r - eliminate * gradient_t));
  step.tail<2>() = -(H_tt_inverse * (gradient_t + H_rt.transpose() * step.head<3>()));
  return step;
}

EpipolarModel Moved(const EpipolarModel& model, const Vector5& step) {
  const Eigen::Vector3d move = TangentBasis(model.direction) * step.tail<2>();
  return {Rotation::Exp(step.head<3>()) * model.j_from_i, (model.direction + move).normalized()};
}

}  // namespace

EpipolarFit RefineEpipolar(const PairArrays& pairs,
                           const EpipolarModel& start,
                           double loss,
                           int max_iterations,
                           double tolerance) {
  constexpr double kLargestDamping = 1e4;
  EpipolarFit fit{start, LinearizeEpipolar(pairs, start, loss)};
  double damping = 1e-4;
  for (int iteration = 0; iteration < max_iterations && damping < kLargestDamping; ++iteration) {
    const Vector5 step = DampedStep(fit.normal, damping);
    if (!step.allFinite()) {
      damping *= 10.0;
      continue;
    }
    // Decrease of the cost predicted by the quadratic model without damping.
    const double promised =
        -step.dot(2.0 * fit.normal.gradient + fit.normal.H.selfadjointView<Eigen::Upper>() * step);
    if (promised <= tolerance * fit.normal.cost) break;
    const EpipolarModel candidate = Moved(fit.model, step);
    const EpipolarNormal next = LinearizeEpipolar(pairs, candidate, loss);
    if (next.cost <= fit.normal.cost) {
      fit = {candidate, next};
      damping = std::max(0.1 * damping, 1e-8);
    } else {
      damping *= 10.0;
    }
  }
  return fit;
}

RotationFit RefineRotation(const PairArrays& pairs,
                           const Rotation& start,
                           double loss,
                           int max_iterations) {
  RotationFit fit{start, Eigen::Matrix3d::Zero()};
  for (int iteration = 0; iteration < max_iterations; ++iteration) {
    const RotationNormal normal = LinearizeRotation(pairs, fit.j_from_i, loss);
    fit.H = normal.H;
    const Eigen::Vector3d step = -(fit.H.inverse() * normal.gradient);
    if (!step.allFinite()) break;
    fit.j_from_i = Rotation::Exp(step) * fit.j_from_i;
    if (step.norm() < 1e-9) break;
  }
  return fit;
}

Eigen::Matrix3d TranslationAxes(const PairArrays& pairs, const Rotation& j_from_i) {
  Eigen::Matrix3d M = Eigen::Matrix3d::Zero();
  const Eigen::Matrix3d R_j_i = j_from_i.Matrix();
  for (int k = 0; k < pairs.size(); ++k) {
    const Eigen::Vector3d n = (R_j_i * pairs.BearingI(k)).cross(pairs.BearingJ(k));
    // Normalised, so that the influence of a single outlier is bounded.
    M += n * n.transpose() / (n.squaredNorm() + 1e-6);
  }
  return Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(M).eigenvectors();
}

double NoiseOf(const std::vector<double>& squared_distances, double threshold, double smallest) {
  const std::ptrdiff_t half = CountBelow(squared_distances, threshold * threshold) / 2;
  if (half == 0) return threshold;
  // Median by bisection of its logarithm; passes without branches are faster than sorting.
  constexpr double kPrecision = 1.002;
  double low = std::min(smallest / kSigmasPerMedianDeviation, threshold);
  double high = threshold;
  while (high > kPrecision * low) {
    const double middle = std::sqrt(low * high);
    (CountBelow(squared_distances, middle * middle) > half ? high : low) = middle;
  }
  return std::max(kSigmasPerMedianDeviation * std::sqrt(low * high), smallest);
}

}  // namespace rotslam
