#include "rotodom/relative_rotation/relative_rotation.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

#include <Eigen/Dense>

#include "rotodom/relative_rotation/consensus.h"
#include "rotodom/relative_rotation/information_criterion.h"
#include "rotodom/relative_rotation/refinement.h"

namespace rotslam {
namespace {

// Gauss-Newton steps on all matches at the end, at most; it stops before where steps vanish.
constexpr int kRefineIterations = 12;

// Selects the rotation independently of the test for a baseline. Where both models fit, as with a
// narrow overlap after a large rotation, the rotation-only model would absorb a small baseline.
// @param squared_distances, squared_flows  of all pairs under either model, rad^2.
bool RotationExplains(const std::vector<double>& squared_distances,
                      const std::vector<double>& squared_flows,
                      double noise) {
  return RotationCriterion(squared_flows, noise) < EpipolarCriterion(squared_distances, noise);
}

std::vector<KeypointCovariances> SelectCovariances(
    const std::vector<int>& members, std::span<const KeypointCovariances> covariances) {
  std::vector<KeypointCovariances> of_members;
  if (covariances.empty()) return of_members;
  of_members.reserve(members.size());
  for (const int index : members) of_members.push_back(covariances[index]);
  return of_members;
}

// Share of the epipolar model's inliers that a rotation must explain to replace it. A test between
// two models does not detect that both are wrong.
constexpr double kMinShareByRotation = 0.7;

int NumBelow(const std::vector<double>& squares, double limit) {
  return static_cast<int>(std::count_if(
      squares.begin(), squares.end(), [&](double square) { return square <= limit; }));
}

// Sign of the direction that puts most points in front of both cameras.
Eigen::Vector3d WithForwardSign(const PairArrays& pairs,
                                const std::vector<int>& inliers,
                                const EpipolarModel& model) {
  const Eigen::Matrix3d R_j_i = model.j_from_i.Matrix();
  int votes = 0;
  for (const int index : inliers) {
    // With x_j = depth_i g + t in front of the camera, the bearing moves from g towards t.
    const Eigen::Vector3d g = R_j_i * pairs.BearingI(index);
    const Eigen::Vector3d turn = g.cross(pairs.BearingJ(index));
    votes += turn.dot(g.cross(model.direction)) > 0.0 ? 1 : -1;
  }
  return votes >= 0 ? model.direction : Eigen::Vector3d(-model.direction);
}

void CheckInputs(const MatchedBearings& matches, const RelativeRotationOptions& options) {
  if (const auto problem = options.Problem()) {
    throw std::invalid_argument("RelativeRotationOptions: " + *problem);
  }
  if (!matches.covariances.empty() && matches.covariances.size() != matches.pairs.size()) {
    throw std::invalid_argument("EstimateRelativeRotation: not one covariance per pair");
  }
  for (const BearingPair& pair : matches.pairs) {
    if (!pair.bearing_i.allFinite() || !pair.bearing_j.allFinite()) {
      throw std::invalid_argument("EstimateRelativeRotation: a bearing is not finite");
    }
    if (!pair.noise) continue;
    const Eigen::Matrix2d& C = pair.noise->covariance_j;
    // Computed covariances are symmetric and positive up to rounding only.
    const double rounding = 1e-9 * C.trace() * C.trace();
    const double skew = C(0, 1) - C(1, 0);
    const bool valid = C.allFinite() && C(0, 0) >= 0.0 && C(1, 1) >= 0.0 &&
                       C.determinant() >= -rounding && skew * skew <= rounding &&
                       std::isfinite(pair.noise->variance_i) && pair.noise->variance_i >= 0.0;
    if (!valid) {
      throw std::invalid_argument("EstimateRelativeRotation: a match's covariance is none");
    }
  }
}

// Whether the matches determine the rotation: no eigenvalue is at the level of rounding.
bool IsFixed(const Eigen::Matrix3d& information) {
  const Eigen::Vector3d eigenvalues =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(information, Eigen::EigenvaluesOnly)
          .eigenvalues();
  return eigenvalues[0] > 1e-10 * eigenvalues[2];
}

// The model refined on the members of its consensus.
struct RefinedMembers {
  PairArrays arrays;
  double loss = 0.0;
  EpipolarFit epipolar;
  std::vector<double> squared_distances;  // to `epipolar`, rad^2
  double noise = 0.0;                     // standard deviation of these distances, rad
};

RefinedMembers RefineMembers(const PairArrays& all,
                             const Consensus& consensus,
                             double threshold,
                             double smallest_noise) {
  RefinedMembers refined;
  refined.arrays = PairArrays(all, consensus.members);
  refined.loss =
      kLossSigmas *
      NoiseOf(SquaredDistances(refined.arrays, consensus.model), threshold, smallest_noise);
  refined.epipolar =
      RefineEpipolar(refined.arrays, consensus.model, refined.loss, kRefineIterations, 1e-9);
  refined.squared_distances = SquaredDistances(refined.arrays, refined.epipolar.model);
  refined.noise = NoiseOf(refined.squared_distances, threshold, smallest_noise);
  return refined;
}

// Sets the rotation of the model without a baseline.
void SelectRotation(const RotationFit& rotation,
                    double noise,
                    double shared_error,
                    RelativeRotationEstimate& estimate) {
  // A baseline whose flow is below the shared error is absorbed by the rotation; on rendered
  // gimbals by half.
  const double absorbed = 0.5 * shared_error;
  estimate.j_from_i = rotation.j_from_i;
  estimate.covariance = 2.0 * noise * noise * rotation.H.inverse() +
                        absorbed * absorbed * Eigen::Matrix3d::Identity();
}

// Sets the rotation of the epipolar model and, where there is a baseline, its direction.
void SelectEpipolar(const PairArrays& all,
                    const EpipolarFit& epipolar,
                    double noise,
                    RelativeRotationEstimate& estimate) {
  const Eigen::Matrix<double, 5, 5> covariance = noise * noise * epipolar.normal.H.inverse();
  estimate.j_from_i = epipolar.model.j_from_i;
  estimate.covariance = covariance.topLeftCorner<3, 3>();
  if (estimate.rotation_only) return;
  estimate.translation_direction = WithForwardSign(all, estimate.inliers, epipolar.model);
  const Eigen::Matrix<double, 3, 2> basis = TangentBasis(epipolar.model.direction);
  estimate.translation_covariance =
      basis * covariance.bottomRightCorner<2, 2>() * basis.transpose();
}

// Refines the model on its members, tests the baseline, and selects the rotation.
std::optional<RelativeRotationEstimate> EstimateFrom(
    const PairArrays& all,
    const Consensus& consensus,
    double focal_px,
    const RelativeRotationOptions& options,
    std::span<const KeypointCovariances> covariances) {
  const double threshold = options.inlier_px / focal_px;
  const double shared_error = options.shared_error_px / focal_px;
  if (consensus.num_inliers < options.min_inliers) return std::nullopt;
  const auto [arrays, loss, epipolar, squared_distances, noise] =
      RefineMembers(all, consensus, threshold, kMinNoisePx / focal_px);
  RelativeRotationEstimate estimate;
  estimate.num_samples = consensus.num_samples;
  estimate.excess = consensus.excess;
  estimate.translation_direction.setZero();
  estimate.translation_covariance.setZero();

  const std::vector<double> squared_flows = SquaredFlows(arrays, epipolar.model.j_from_i);
  double squared_flow = 0.0;
  for (int index = 0; index < arrays.size(); ++index) {
    if (!(squared_distances[index] <= threshold * threshold)) continue;
    estimate.inliers.push_back(consensus.members[index]);
    squared_flow += squared_flows[index];
  }
  if (static_cast<int>(estimate.inliers.size()) < options.min_inliers) return std::nullopt;
  const double num_inliers = static_cast<double>(estimate.inliers.size());
  estimate.parallax_px = std::sqrt(squared_flow / num_inliers) * focal_px;
  estimate.noise_px = noise * focal_px;

  const RotationFit rotation =
      RefineRotation(arrays, epipolar.model.j_from_i, 2.0 * loss, kRefineIterations);
  estimate.baseline = TestBaseline(arrays,
                                   SelectCovariances(consensus.members, covariances),
                                   {rotation.j_from_i, epipolar.model},
                                   {focal_px, options.shared_error_px},
                                   options.baseline);
  const std::vector<double> flows_by_rotation = SquaredFlows(arrays, rotation.j_from_i);
  estimate.rotation_only =
      !estimate.baseline.ShowsBaseline() &&
      NumBelow(flows_by_rotation, 2.0 * threshold * threshold) >= kMinShareByRotation * num_inliers;
  // The block of the rotation bounds the information of both models.
  if (!IsFixed(rotation.H)) return std::nullopt;
  if (RotationExplains(squared_distances, flows_by_rotation, std::hypot(noise, shared_error))) {
    SelectRotation(rotation, noise, shared_error, estimate);
  } else {
    SelectEpipolar(all, epipolar, noise, estimate);
  }
  if (!estimate.covariance.allFinite() || !estimate.translation_covariance.allFinite()) {
    return std::nullopt;
  }
  return estimate;
}

}  // namespace

std::vector<RelativeRotationEstimate> EstimateRotationHypotheses(
    const MatchedBearings& matches,
    const Rotation& predicted_j_from_i,
    double focal_px,
    const RelativeRotationOptions& options,
    std::uint64_t seed) {
  CheckInputs(matches, options);
  if (static_cast<int>(matches.pairs.size()) < options.min_inliers) return {};

  const PairArrays all(matches.pairs);
  std::vector<RelativeRotationEstimate> estimates;
  for (const Consensus& consensus :
       FindConsensus(all, predicted_j_from_i, focal_px, options, seed)) {
    auto estimate = EstimateFrom(all, consensus, focal_px, options, matches.covariances);
    // Without an estimate from the best hypothesis the others are not used.
    if (!estimate) break;
    estimates.push_back(*std::move(estimate));
  }
  return estimates;
}

std::optional<RelativeRotationEstimate> EstimateRelativeRotation(
    const MatchedBearings& matches,
    const Rotation& predicted_j_from_i,
    double focal_px,
    const RelativeRotationOptions& options,
    std::uint64_t seed) {
  auto estimates = EstimateRotationHypotheses(matches, predicted_j_from_i, focal_px, options, seed);
  if (estimates.empty()) return std::nullopt;
  return std::move(estimates.front());
}

std::optional<RelativeRotationEstimate> UpdateRelativeRotation(
    const MatchedBearings& matches,
    const EpipolarModel& known,
    const Rotation& predicted_j_from_i,
    double focal_px,
    const RelativeRotationOptions& options) {
  CheckInputs(matches, options);
  if (static_cast<int>(matches.pairs.size()) < options.min_inliers) return std::nullopt;
  const PairArrays all(matches.pairs);
  const Consensus consensus = FollowConsensus(all, known, predicted_j_from_i, focal_px, options);
  return EstimateFrom(all, consensus, focal_px, options, matches.covariances);
}

}  // namespace rotslam
