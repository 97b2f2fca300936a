#include "output/trajectory/metrics.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numeric>
#include <stdexcept>

#include <Eigen/Dense>

#include "rotodom/types/options.h"
#include "rotodom/types/parallel.h"

namespace rotslam {
namespace {

double RootMeanSquare(const std::vector<double>& errors) {
  double sum = 0.0;
  for (const double error : errors) sum += error * error;
  return std::sqrt(sum / static_cast<double>(errors.size()));
}

// Linear between the two nearest samples.
double Quantile(const std::vector<double>& sorted, double fraction) {
  const double position = fraction * static_cast<double>(sorted.size() - 1);
  const std::size_t below = static_cast<std::size_t>(position);
  const std::size_t above = std::min(below + 1, sorted.size() - 1);
  const double weight = position - static_cast<double>(below);
  return (1.0 - weight) * sorted[below] + weight * sorted[above];
}

// Offsets D_k = E_k G_k^-1 between the two worlds. The relative error from k to l,
// (G_k^-1 G_l)^-1 (E_k^-1 E_l), is D_k^-1 D_l up to conjugation by a rotation: the same angle.
std::vector<Eigen::Quaterniond> WorldOffsets(const std::vector<PosePair>& pairs) {
  std::vector<Eigen::Quaterniond> offsets;
  offsets.reserve(pairs.size());
  for (const PosePair& pair : pairs) {
    offsets.push_back(
        (pair.estimate.world_from_cam * pair.ground_truth.world_from_cam.Inverse()).Quaternion());
  }
  return offsets;
}

double AngleDegBetween(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b) {
  const Eigen::Quaterniond difference = a.conjugate() * b;
  return 2.0 * std::atan2(difference.vec().norm(), std::abs(difference.w())) * kDegFromRad;
}

std::vector<double> StepErrorsDeg(const std::vector<Eigen::Quaterniond>& offsets, int step) {
  std::vector<double> errors;
  errors.reserve(offsets.size() - static_cast<std::size_t>(step));
  for (std::size_t k = 0; k + static_cast<std::size_t>(step) < offsets.size(); ++k) {
    errors.push_back(AngleDegBetween(offsets[k], offsets[k + static_cast<std::size_t>(step)]));
  }
  return errors;
}

double MeanStepErrorDeg(const std::vector<Eigen::Quaterniond>& offsets, int num_threads) {
  const int num_steps = static_cast<int>(offsets.size()) - 1;
  std::vector<double> step_rms(static_cast<std::size_t>(num_steps));
  ParallelFor(num_steps, num_threads, [&](int index) {
    step_rms[static_cast<std::size_t>(index)] = RootMeanSquare(StepErrorsDeg(offsets, index + 1));
  });
  return std::accumulate(step_rms.begin(), step_rms.end(), 0.0) / num_steps;
}

// Distance driven from the first pose to each.
std::vector<double> DrivenDistances(const std::vector<PosePair>& pairs) {
  std::vector<double> distances = {0.0};
  for (std::size_t k = 1; k < pairs.size(); ++k) {
    distances.push_back(
        distances.back() +
        (pairs[k].ground_truth.center_in_world - pairs[k - 1].ground_truth.center_in_world).norm());
  }
  return distances;
}

std::optional<double> KittiRotationError(const std::vector<Eigen::Quaterniond>& offsets,
                                         const std::vector<double>& distances) {
  double sum = 0.0;
  int count = 0;
  for (std::size_t first = 0; first < offsets.size(); first += 10) {
    for (double length_m = 100.0; length_m <= 800.0; length_m += 100.0) {
      const auto last =
          std::lower_bound(distances.begin(), distances.end(), distances[first] + length_m);
      if (last == distances.end()) break;
      const auto last_index = static_cast<std::size_t>(last - distances.begin());
      sum += AngleDegBetween(offsets[first], offsets[last_index]) / length_m * 100.0;
      ++count;
    }
  }
  if (count == 0) return std::nullopt;
  return sum / count;
}

struct SimilarityFit {
  double rms = 0.0;
  double scale = 1.0;
};

// Similarity that brings the estimate's centres onto the ground truth's (Umeyama, eqs. 40-42).
std::optional<SimilarityFit> FitSimilarity(const std::vector<PosePair>& pairs) {
  const auto n = static_cast<Eigen::Index>(pairs.size());
  Eigen::Matrix3Xd truth(3, n);
  Eigen::Matrix3Xd estimate(3, n);
  for (Eigen::Index k = 0; k < n; ++k) {
    truth.col(k) = pairs[static_cast<std::size_t>(k)].ground_truth.center_in_world;
    estimate.col(k) = pairs[static_cast<std::size_t>(k)].estimate.center_in_world;
  }
  truth.colwise() -= truth.rowwise().mean().eval();
  estimate.colwise() -= estimate.rowwise().mean().eval();
  const double spread_truth = std::sqrt(truth.squaredNorm() / static_cast<double>(n));
  const double spread_estimate = std::sqrt(estimate.squaredNorm() / static_cast<double>(n));
  if (spread_truth < 1e-6 || spread_estimate < 1e-12) return std::nullopt;
  const Eigen::Matrix3d covariance = truth * estimate.transpose();
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(covariance,
                                              Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d signs = Eigen::Vector3d::Ones();
  if ((svd.matrixU() * svd.matrixV().transpose()).determinant() < 0.0) signs.z() = -1.0;
  const Eigen::Matrix3d R = svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose();
  SimilarityFit fit;
  fit.scale = svd.singularValues().dot(signs) / estimate.squaredNorm();
  fit.rms = std::sqrt((truth - fit.scale * R * estimate).squaredNorm() / static_cast<double>(n));
  return fit;
}

}  // namespace

std::optional<std::string> MetricsOptions::Problem() const {
  if (!(max_gap_s >= 0.0)) return OutOfRange("max_gap_s", max_gap_s, "at least 0");
  if (!(exact_s >= 0.0)) return OutOfRange("exact_s", exact_s, "at least 0");
  if (num_threads < 1) return OutOfRange("num_threads", num_threads, "at least 1");
  return std::nullopt;
}

std::vector<PosePair> AssociatePoses(const Trajectory& ground_truth,
                                     const Trajectory& estimate,
                                     const MetricsOptions& options) {
  if (const auto problem = options.Problem()) {
    throw std::invalid_argument("MetricsOptions: " + *problem);
  }
  std::vector<PosePair> pairs;
  for (const StampedPose& pose : estimate) {
    const auto truth = PoseAt(ground_truth, pose.timestamp_s, options.exact_s, options.max_gap_s);
    if (truth) {
      pairs.push_back({*truth, pose});
    }
  }
  return pairs;
}

TrajectoryMetrics ComputeMetrics(const std::vector<PosePair>& pairs,
                                 const MetricsOptions& options) {
  if (const auto problem = options.Problem()) {
    throw std::invalid_argument("MetricsOptions: " + *problem);
  }
  if (pairs.size() < 3) throw std::invalid_argument("ComputeMetrics: needs three pairs or more");
  const std::vector<Eigen::Quaterniond> offsets = WorldOffsets(pairs);
  const std::vector<double> distances = DrivenDistances(pairs);
  std::vector<double> step_errors_deg = StepErrorsDeg(offsets, 1);
  std::sort(step_errors_deg.begin(), step_errors_deg.end());

  TrajectoryMetrics metrics;
  metrics.num_poses = static_cast<int>(pairs.size());
  metrics.rpe1_deg = RootMeanSquare(step_errors_deg);
  metrics.rpe1_median_deg = Quantile(step_errors_deg, 0.5);
  metrics.rpe1_p90_deg = Quantile(step_errors_deg, 0.9);
  metrics.rpe1_max_deg = step_errors_deg.back();
  metrics.rpen_deg = MeanStepErrorDeg(offsets, options.num_threads);
  metrics.r_err_deg_per_100m = KittiRotationError(offsets, distances);
  if (const auto fit = FitSimilarity(pairs)) {
    metrics.ate_m = fit->rms;
    metrics.scale = fit->scale;
  }
  metrics.path_length_m = distances.back();
  return metrics;
}

}  // namespace rotslam
