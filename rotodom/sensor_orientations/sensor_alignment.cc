#include "rotodom/sensor_orientations/sensor_alignment.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/SVD>

#include "rotodom/sensor_orientations/world_walk.h"

namespace rotslam {
namespace {

using Vector4 = Eigen::Matrix<double, 4, 1>;  // offset, rotation of the mounting
using Matrix4 = Eigen::Matrix<double, 4, 4>;

// Duration of the rotations compared in the search, s: motion of hands changes about as fast.
constexpr double kSearchTurnS = 0.3;
// Steps of the search: of the frame interval, and at most, s.
constexpr double kSearchStep = 0.5;
constexpr double kLongestStepS = 0.02;
// Offsets at which fewer than this share of the most rotations can be compared are passed over.
constexpr double kLeastOverlap = 0.5;
constexpr int kNumReweightings = 5;
// Pull towards the identity about axes that the motion does not tell, of the whole weight.
constexpr double kPull = 1e-6;
constexpr int kMaxIterations = 20;
constexpr double kOffsetStepS = 1e-6;
constexpr double kMountingStep = 1e-7;  // rad
// Residual in deviations beyond which the robust (Geman-McClure) cost goes flat.
constexpr double kLossSigmas = 6.0;
// Deviations beyond which an offset is more than chance; the same level for three components.
constexpr double kOffsetSigmas = 3.0;
constexpr double kMountingSigmas = 3.8;

// What is known before of offset (s) and mounting (rad): keeps the equations solvable.
const Vector4 kPriorSigma(1.0, 1.0, 1.0, 1.0);

// Rotation vectors of the same turns, of the camera and the sensor, about their own axes.
struct Turns {
  std::vector<Eigen::Vector3d> camera;
  std::vector<Eigen::Vector3d> sensor;
};

Turns TurnsOf(const std::vector<OrientationPair>& pairs, const std::vector<int>& num_breaks) {
  Turns turns;
  turns.camera.reserve(pairs.size());
  turns.sensor.reserve(pairs.size());
  std::size_t to = 0;
  for (const OrientationPair& from : pairs) {
    while (to < pairs.size() && pairs[to].timestamp_s < from.timestamp_s + kSearchTurnS) ++to;
    if (to == pairs.size()) break;
    if (num_breaks[pairs[to].frame] != num_breaks[from.frame]) continue;
    turns.camera.push_back((pairs[to].cam_from_world * from.cam_from_world.Inverse()).Log());
    turns.sensor.push_back((pairs[to].sensor_from_world * from.sensor_from_world.Inverse()).Log());
  }
  return turns;
}

// The rotation that takes the sensor's turns to the camera's with the smallest sum of distances,
// and the mean of these over the mean length of the turns.
struct TurnFit {
  Rotation cam_from_sensor;
  double distance = std::numeric_limits<double>::infinity();
};

TurnFit FitTurns(const Turns& turns) {
  std::vector<double> weights(turns.camera.size(), 1.0);
  TurnFit fit;
  for (int round = 0; round < kNumReweightings; ++round) {
    Eigen::Matrix3d moments = Eigen::Matrix3d::Zero();
    double total = 0.0;
    for (std::size_t k = 0; k < weights.size(); ++k) {
      moments += weights[k] * turns.camera[k] * turns.sensor[k].transpose();
      total += weights[k] * turns.camera[k].norm() * turns.sensor[k].norm();
    }
    moments += kPull * (total + 1e-12) * Eigen::Matrix3d::Identity();
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(moments, Eigen::ComputeFullU | Eigen::ComputeFullV);
    const Eigen::Matrix3d& U = svd.matrixU();
    const Eigen::Matrix3d& V = svd.matrixV();
    const Eigen::Vector3d signs(1.0, 1.0, (U * V.transpose()).determinant() < 0.0 ? -1.0 : 1.0);
    fit.cam_from_sensor = Rotation::FromMatrix(U * signs.asDiagonal() * V.transpose());
    double distance = 0.0;
    double length = 1e-9;
    for (std::size_t k = 0; k < weights.size(); ++k) {
      const double error = (turns.camera[k] - fit.cam_from_sensor * turns.sensor[k]).norm();
      distance += error;
      length += turns.camera[k].norm();
      weights[k] = 1.0 / std::max(error, 1e-4);
    }
    fit.distance = distance / length;
  }
  return fit;
}

class Aligner {
 public:
  Aligner(const OrientationPairing& pairing, const std::vector<double>& step_variance)
      : pairing_(pairing), step_variance_(step_variance), num_breaks_(step_variance.size() + 1, 0) {
    for (std::size_t k = 0; k < step_variance.size(); ++k) {
      num_breaks_[k + 1] = num_breaks_[k] + (std::isfinite(step_variance[k]) ? 0 : 1);
    }
  }

  // The best offset of a search, the mounting in closed form.
  SensorAlignment Search(double max_offset_s) const {
    const double step_s = std::min(kSearchStep * pairing_.frame_interval_s(), kLongestStepS);
    const int num_steps = static_cast<int>(std::ceil(max_offset_s / step_s));
    std::vector<Turns> turns;
    turns.reserve(2 * num_steps + 1);
    std::size_t most = 1;
    for (int k = -num_steps; k <= num_steps; ++k) {
      turns.push_back(TurnsOf(pairing_.At(k * step_s), num_breaks_));
      most = std::max(most, turns.back().camera.size());
    }
    SensorAlignment best;
    double least = std::numeric_limits<double>::infinity();
    for (int k = -num_steps; k <= num_steps; ++k) {
      const Turns& these = turns[k + num_steps];
      if (static_cast<double>(these.camera.size()) < kLeastOverlap * static_cast<double>(most)) {
        continue;
      }
      const TurnFit fit = FitTurns(these);
      if (fit.distance >= least) continue;
      least = fit.distance;
      best.offset_s = k * step_s;
      best.cam_from_sensor = fit.cam_from_sensor;
    }
    return best;
  }

  SensorAlignment AtZeroOffset() const {
    SensorAlignment alignment;
    alignment.cam_from_sensor = FitTurns(TurnsOf(pairing_.At(0.0), num_breaks_)).cam_from_sensor;
    return alignment;
  }

  // Gauss-Newton steps from a start, with the deviations.
  SensorAlignment Refine(SensorAlignment alignment, bool free_offset, bool free_mounting) const {
    const double largest_step_s = std::min(pairing_.frame_interval_s(), kLongestStepS);
    Matrix4 covariance = Matrix4::Zero();
    for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
      const Equations equations = EquationsAt(alignment, free_offset, free_mounting);
      const Eigen::LDLT<Matrix4> factor(equations.normal);
      Vector4 step = -factor.solve(equations.gradient);
      covariance = equations.scale * factor.solve(Matrix4::Identity());
      step[0] = std::clamp(step[0], -largest_step_s, largest_step_s);
      alignment.offset_s += step[0];
      alignment.cam_from_sensor = Rotation::Exp(step.tail<3>()) * alignment.cam_from_sensor;
      if (std::abs(step[0]) < kOffsetStepS && step.tail<3>().norm() < kMountingStep) break;
    }
    if (free_offset) alignment.offset_sigma_s = std::sqrt(covariance(0, 0));
    if (free_mounting) alignment.mounting_covariance = covariance.bottomRightCorner<3, 3>();
    return alignment;
  }

 private:
  struct Equations {
    Matrix4 normal;
    Vector4 gradient;
    double scale = 1.0;  // of the variances, by the residuals
  };

  Equations EquationsAt(const SensorAlignment& alignment,
                        bool free_offset,
                        bool free_mounting) const {
    const std::vector<OrientationPair> pairs = pairing_.At(alignment.offset_s);
    const WorldWalk walk(pairs, alignment.cam_from_sensor, step_variance_);
    const SensorNoise noise = walk.Noise();
    const auto num_pairs = static_cast<Eigen::Index>(pairs.size());
    // y, then its derivatives by the four unknowns, three columns each.
    Eigen::MatrixXd values = Eigen::MatrixXd::Zero(num_pairs, 15);
    values.leftCols<3>() = walk.vectors();
    for (Eigen::Index m = 0; m < num_pairs; ++m) {
      const OrientationPair& pair = pairs[m];
      // Exp(x) X moves E to E Exp((X B)^-1 x), and the sensor's clock as a turn of the camera at
      // its rate does.
      const Eigen::Matrix3d J =
          (alignment.cam_from_sensor * pair.sensor_from_world).Inverse().Matrix();
      if (free_offset) {
        values.block<1, 3>(m, 3) = (J * pairing_.images().RateAt(pair.timestamp_s)).transpose();
      }
      for (int axis = 0; axis < 3 && free_mounting; ++axis) {
        values.block<1, 3>(m, 6 + 3 * axis) = J.col(axis).transpose();
      }
    }
    Eigen::VectorXd weights = Eigen::VectorXd::Ones(num_pairs);
    for (int round = 0; round < 2; ++round) {
      const Eigen::MatrixXd residuals = walk.Residuals(noise, weights, values.leftCols<3>());
      for (Eigen::Index m = 0; m < num_pairs; ++m) {
        const double ratio =
            residuals.row(m).squaredNorm() / (noise.variance * kLossSigmas * kLossSigmas);
        weights[m] = noise.is_outlier[m] ? 0.0 : 1.0 / ((1.0 + ratio) * (1.0 + ratio));
      }
      // A chain needs a weight.
      for (const FrameChain& chain : walk.chains()) weights[chain.begin] += 1e-9;
    }
    const Eigen::MatrixXd residuals = walk.Residuals(noise, weights, values);
    Equations equations;
    equations.normal = kPriorSigma.cwiseAbs2().cwiseInverse().asDiagonal();
    equations.gradient.setZero();
    double squared = 0.0;
    for (int axis = 0; axis < 3; ++axis) {
      for (Eigen::Index m = 0; m < num_pairs; ++m) {
        const double weight = weights[m] / noise.variance;
        squared += weight * values(m, axis) * residuals(m, axis);
        for (int a = 0; a < 4; ++a) {
          const double moved = weight * values(m, 3 + 3 * a + axis);
          equations.gradient[a] += moved * residuals(m, axis);
          for (int b = 0; b < 4; ++b) {
            equations.normal(a, b) += moved * residuals(m, 3 + 3 * b + axis);
          }
        }
      }
    }
    const double freedom = 3.0 * (weights.sum() - static_cast<double>(walk.chains().size())) - 4.0;
    if (freedom > 0.0) equations.scale = std::max(1.0, squared / freedom);
    return equations;
  }

  const OrientationPairing& pairing_;
  const std::vector<double>& step_variance_;
  std::vector<int> num_breaks_;  // before each frame
};

bool HasOffset(const SensorAlignment& alignment) {
  return std::abs(alignment.offset_s) > kOffsetSigmas * alignment.offset_sigma_s;
}

bool HasMounting(const SensorAlignment& alignment) {
  const Eigen::Vector3d turn = alignment.cam_from_sensor.Log();
  return turn.dot(alignment.mounting_covariance.ldlt().solve(turn)) >
         kMountingSigmas * kMountingSigmas;
}

// Takes out of a small mounting what is no more than chance: the angle about an axis that the
// motion does not tell.
void DropWhatIsChance(SensorAlignment& alignment) {
  constexpr double kSigmas = 2.0;
  constexpr double kSmall = 0.35;  // rad; larger ones are other axes, and not small changes
  const Eigen::Vector3d turn = alignment.cam_from_sensor.Log();
  if (turn.norm() > kSmall) return;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(alignment.mounting_covariance);
  Eigen::Vector3d kept = Eigen::Vector3d::Zero();
  for (int k = 0; k < 3; ++k) {
    const Eigen::Vector3d axis = axes.eigenvectors().col(k);
    const double angle = axis.dot(turn);
    if (angle * angle > kSigmas * kSigmas * axes.eigenvalues()[k]) kept += angle * axis;
  }
  alignment.cam_from_sensor = Rotation::Exp(kept);
}

}  // namespace

SensorAlignment AlignSensor(const OrientationPairing& pairing,
                            const std::vector<double>& step_variance,
                            double max_offset_s) {
  const Aligner aligner(pairing, step_variance);
  SensorAlignment alignment = aligner.Refine(aligner.Search(max_offset_s), true, true);
  alignment.has_offset = HasOffset(alignment);
  if (!alignment.has_offset) {
    // The mounting for clocks that agree.
    const SensorAlignment in_time = aligner.Refine(aligner.AtZeroOffset(), false, true);
    alignment.cam_from_sensor = in_time.cam_from_sensor;
    alignment.mounting_covariance = in_time.mounting_covariance;
  }
  alignment.has_mounting = HasMounting(alignment);
  if (alignment.has_mounting) DropWhatIsChance(alignment);
  if (alignment.has_offset && !alignment.has_mounting) {
    SensorAlignment in_place = alignment;
    in_place.cam_from_sensor = Rotation();
    in_place = aligner.Refine(in_place, true, false);
    alignment.offset_s = in_place.offset_s;
    alignment.offset_sigma_s = in_place.offset_sigma_s;
  }
  return alignment;
}

}  // namespace rotslam
