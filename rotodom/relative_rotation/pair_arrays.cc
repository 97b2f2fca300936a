#include "rotodom/relative_rotation/pair_arrays.h"

#include <algorithm>
#include <array>
#include <limits>

#include <Eigen/Dense>

#include "rotodom/simd/simd_level.h"

namespace rotslam {
namespace {

PairModel Plain(const EpipolarModel& model) {
  PairModel plain;
  const Eigen::Matrix3d R_j_i = model.j_from_i.Matrix();
  const Eigen::Matrix<double, 3, 2> basis = TangentBasis(model.direction);
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) plain.R[3 * row + column] = R_j_i(row, column);
    plain.t[row] = model.direction[row];
    plain.u[row] = basis(row, 0);
    plain.v[row] = basis(row, 1);
  }
  return plain;
}

const PairLoops& BestPairLoops() {
#if defined(__x86_64__)
  switch (UsedSimdLevel()) {
    case SimdLevel::kAvx512:
      return kPairLoopsAvx512;
    case SimdLevel::kAvx2:
      return kPairLoopsAvx2;
    case SimdLevel::kBaseline:
      break;
  }
#endif
  return kPairLoopsBaseline;
}

}  // namespace

PairArrays::PairArrays(std::span<const BearingPair> pairs) {
  const bool weighted = std::any_of(
      pairs.begin(), pairs.end(), [](const BearingPair& pair) { return pair.noise.has_value(); });
  Allocate(static_cast<int>(pairs.size()), weighted);
  const auto set_symmetric = [&](int row, int k, const Eigen::Matrix3d& A) {
    for (int a = 0; a < 3; ++a) {
      for (int b = a; b < 3; ++b) MutableRow(row++)[k] = A(a, b);
    }
  };
  for (int k = 0; k < size_; ++k) {
    const BearingPair& pair = pairs[k];
    for (int axis = 0; axis < 3; ++axis) {
      MutableRow(PairRows::kBearingI + axis)[k] = pair.bearing_i[axis];
      MutableRow(PairRows::kBearingJ + axis)[k] = pair.bearing_j[axis];
    }
    if (!weighted) continue;
    const MatchNoise noise = pair.noise.value_or(MatchNoise{});
    const Eigen::Matrix<double, 3, 2> basis = TangentBasis(pair.bearing_j);
    const Eigen::Matrix3d along = pair.bearing_j * pair.bearing_j.transpose();
    set_symmetric(
        PairRows::kCovarianceJ, k, along + basis * noise.covariance_j * basis.transpose());
    MutableRow(PairRows::kVarianceI)[k] = noise.variance_i;
    // A small constant keeps the weight of a match with zero covariance finite.
    Eigen::Matrix2d mean = 0.5 * noise.covariance_j;
    mean.diagonal().array() += 0.5 * noise.variance_i + 1e-6;
    set_symmetric(PairRows::kInformation, k, along + basis * mean.inverse() * basis.transpose());
  }
}

PairArrays::PairArrays(const PairArrays& all, std::span<const int> indices) {
  Allocate(static_cast<int>(indices.size()), all.weighted());
  const int num_rows = weighted_ ? PairRows::kWeightedRows : PairRows::kNominalRows;
  for (int row = 0; row < num_rows; ++row) {
    const double* from = all.row(row);
    double* to = MutableRow(row);
    for (int k = 0; k < size_; ++k) to[k] = from[indices[k]];
  }
}

PairArrays PairArrays::Thinned(int count) const {
  if (size_ <= count) return *this;
  std::vector<int> indices(count);
  for (int k = 0; k < count; ++k) {
    indices[k] = static_cast<int>(std::int64_t{k} * size_ / count);
  }
  return PairArrays(*this, indices);
}

Eigen::Vector3d PairArrays::BearingI(int index) const {
  return {row(PairRows::kBearingI)[index],
          row(PairRows::kBearingI + 1)[index],
          row(PairRows::kBearingI + 2)[index]};
}

Eigen::Vector3d PairArrays::BearingJ(int index) const {
  return {row(PairRows::kBearingJ)[index],
          row(PairRows::kBearingJ + 1)[index],
          row(PairRows::kBearingJ + 2)[index]};
}

void PairArrays::Allocate(int size, bool weighted) {
  size_ = size;
  weighted_ = weighted;
  padded_size_ = (size + kLanes - 1) / kLanes * kLanes;
  const int num_rows = weighted ? PairRows::kWeightedRows : PairRows::kNominalRows;
  data_.assign(std::size_t(num_rows) * std::size_t(padded_size_), 0.0);
}

EpipolarNormal LinearizeEpipolar(const PairArrays& pairs, const EpipolarModel& model, double loss) {
  constexpr int kUnknowns = EpipolarSums::kUnknowns;
  const PairRows rows = pairs.rows();
  const PairModel plain = Plain(model);
  EpipolarSums sums;
  BestPairLoops().linearize_epipolar(&rows, &plain, loss, &sums);
  EpipolarNormal normal;
  int index = 0;
  for (int row = 0; row < kUnknowns; ++row) {
    for (int column = row; column < kUnknowns; ++column) {
      normal.H(row, column) = normal.H(column, row) = sums.products[index++];
    }
    normal.gradient[row] = sums.gradient[row];
  }
  normal.cost = sums.cost;
  return normal;
}

RotationNormal LinearizeRotation(const PairArrays& pairs, const Rotation& j_from_i, double loss) {
  const PairRows rows = pairs.rows();
  const PairModel plain = Plain({j_from_i, Eigen::Vector3d::UnitX()});
  RotationSums sums;
  BestPairLoops().linearize_rotation(&rows, &plain, loss, &sums);
  RotationNormal normal;
  const double* H = sums.products;
  normal.H << H[0], H[1], H[2], H[1], H[3], H[4], H[2], H[4], H[5];
  normal.gradient << sums.gradient[0], sums.gradient[1], sums.gradient[2];
  return normal;
}

HypothesisScore ScoreEpipolar(const PairArrays& pairs,
                              const EpipolarModel& model,
                              const ScoreBounds& bounds,
                              double limit) {
  const PairRows rows = pairs.rows();
  const PairModel plain = Plain(model);
  const ScoreLimits limits{
      bounds.threshold * bounds.threshold, 1.0 / (bounds.finest * bounds.finest), 0.0, limit};
  PairScore score;
  BestPairLoops().score_lines(&rows, &plain, &limits, &score);
  return {score.score, score.num_inliers};
}

HypothesisScore ScoreHalfLines(const PairArrays& pairs,
                               const EpipolarModel& model,
                               std::vector<double> squared_distances,
                               const ScoreBounds& bounds,
                               double any_way) {
  squared_distances.resize(pairs.padded_size(), std::numeric_limits<double>::infinity());
  const PairRows rows = pairs.rows();
  const PairModel plain = Plain(model);
  const ScoreLimits limits{
      bounds.threshold * bounds.threshold, 1.0 / (bounds.finest * bounds.finest), any_way, 0.0};
  std::array<PairScore, 2> scores;
  BestPairLoops().score_half_lines(&rows, &plain, squared_distances.data(), &limits, scores.data());
  const PairScore& best = scores[scores[0].score <= scores[1].score ? 0 : 1];
  return {best.score, best.num_inliers};
}

std::vector<double> SquaredDistances(const PairArrays& pairs, const EpipolarModel& model) {
  std::vector<double> squared(pairs.padded_size());
  const PairRows rows = pairs.rows();
  const PairModel plain = Plain(model);
  BestPairLoops().squared_distances(&rows, &plain, squared.data());
  squared.resize(pairs.size());
  return squared;
}

std::vector<double> SquaredFlows(const PairArrays& pairs, const Rotation& j_from_i) {
  std::vector<double> squared(pairs.padded_size());
  const PairRows rows = pairs.rows();
  const PairModel plain = Plain({j_from_i, Eigen::Vector3d::UnitX()});
  BestPairLoops().squared_flows(&rows, &plain, squared.data());
  squared.resize(pairs.size());
  return squared;
}

std::ptrdiff_t CountBelow(std::span<const double> values, double limit) {
  return BestPairLoops().count_below(values.data(), std::ssize(values), limit);
}

}  // namespace rotslam
