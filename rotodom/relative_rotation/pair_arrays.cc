#include "rotodom/relative_rotation/pair_arrays.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include <Eigen/Dense>

// The loops are compiled twice, with and without AVX2. Only pointers and doubles cross between the
// two variants; functions with Lanes are inlined, so GCC's warning about passing them does not
// apply.
#if defined(__x86_64__) && defined(__GNUC__)
#define ROTSLAM_HAS_AVX2_VARIANT 1
#define ROTSLAM_AVX2 __attribute__((target("avx2,fma")))
#endif
#define ROTSLAM_INLINE inline __attribute__((always_inline))
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC diagnostic ignored "-Wpsabi"
#endif

namespace rotslam {
namespace {

// Added to the squared Sampson denominator, rad^2: within about 2 deg of the epipole the distance
// has no meaning.
constexpr double kEpipoleFloor = 1e-3;

constexpr int kLanes = PairArrays::kLanes;
using Lanes = double __attribute__((vector_size(kLanes * sizeof(double))));

struct Lanes3 {
  Lanes x, y, z;
};

// Upper triangle of a symmetric matrix.
struct LanesSymmetric3 {
  Lanes xx, xy, xz, yy, yz, zz;
};

ROTSLAM_INLINE Lanes Load(const double* values) {
  Lanes lanes;
  std::memcpy(&lanes, values, sizeof lanes);
  return lanes;
}

ROTSLAM_INLINE Lanes3 Load3(const PairArrays& pairs, int row, int k) {
  return {Load(pairs.row(row) + k), Load(pairs.row(row + 1) + k), Load(pairs.row(row + 2) + k)};
}

ROTSLAM_INLINE LanesSymmetric3 LoadSymmetric3(const PairArrays& pairs, int row, int k) {
  return {Load(pairs.row(row) + k),
          Load(pairs.row(row + 1) + k),
          Load(pairs.row(row + 2) + k),
          Load(pairs.row(row + 3) + k),
          Load(pairs.row(row + 4) + k),
          Load(pairs.row(row + 5) + k)};
}

ROTSLAM_INLINE Lanes Dot(const Lanes3& a, const Lanes3& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
ROTSLAM_INLINE Lanes Dot(const double* a, const Lanes3& b) {
  return a[0] * b.x + a[1] * b.y + a[2] * b.z;
}
ROTSLAM_INLINE Lanes3 Cross(const Lanes3& a, const Lanes3& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
ROTSLAM_INLINE Lanes3 Cross(const double* a, const Lanes3& b) {
  return {a[1] * b.z - a[2] * b.y, a[2] * b.x - a[0] * b.z, a[0] * b.y - a[1] * b.x};
}
ROTSLAM_INLINE Lanes3 Times(const LanesSymmetric3& A, const Lanes3& b) {
  return {A.xx * b.x + A.xy * b.y + A.xz * b.z,
          A.xy * b.x + A.yy * b.y + A.yz * b.z,
          A.xz * b.x + A.yz * b.y + A.zz * b.z};
}
ROTSLAM_INLINE Lanes3 Rotate(const double* R, const Lanes3& b) {
  return {Dot(R, b), Dot(R + 3, b), Dot(R + 6, b)};
}

double Sum(const Lanes& lanes) {
  double sum = 0.0;
  for (int lane = 0; lane < kLanes; ++lane) sum += lanes[lane];
  return sum;
}

// A model in plain arrays for the loops.
struct PlainModel {
  double R[9];  // row-major
  double t[3];
  double u[3];  // tangent basis of t
  double v[3];
};

PlainModel Plain(const EpipolarModel& model) {
  PlainModel plain;
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

// Terms of the numerator e and the variance D of the Sampson distance.
struct Terms {
  Lanes3 g, f, n;  // R f_i, f_j, g x f
  Lanes along_i;   // t . g
  Lanes along_j;   // t . f
  Lanes e;         // t . n
  Lanes D;
  Lanes3 noise;      // C_j (t x g), weighted only
  Lanes variance_i;  // weighted only
};

template <bool kWeighted>
ROTSLAM_INLINE Terms EpipolarTerms(const PairArrays& pairs, const PlainModel& model, int k) {
  Terms terms;
  terms.g = Rotate(model.R, Load3(pairs, PairArrays::kBearingI, k));
  terms.f = Load3(pairs, PairArrays::kBearingJ, k);
  terms.n = Cross(terms.g, terms.f);
  terms.along_i = Dot(model.t, terms.g);
  terms.along_j = Dot(model.t, terms.f);
  terms.e = Dot(model.t, terms.n);
  if constexpr (kWeighted) {
    const Lanes3 t_cross_g = Cross(model.t, terms.g);
    terms.noise = Times(LoadSymmetric3(pairs, PairArrays::kCovarianceJ, k), t_cross_g);
    terms.variance_i = Load(pairs.row(PairArrays::kVarianceI) + k);
    terms.D = terms.variance_i * (1.0 - terms.along_j * terms.along_j) +
              Dot(t_cross_g, terms.noise) + kEpipoleFloor;
  } else {
    terms.D = (2.0 + kEpipoleFloor) - terms.along_i * terms.along_i - terms.along_j * terms.along_j;
  }
  return terms;
}

constexpr int kUnknowns = 5;
constexpr int kProducts = kUnknowns * (kUnknowns + 1) / 2;

// Products of the unknowns' derivatives, upper triangle row by row, then the gradient and the cost.
struct PlainNormal {
  double sums[kProducts + kUnknowns + 1];
};

template <bool kWeighted>
ROTSLAM_INLINE void LinearizeEpipolarLoop(const PairArrays& pairs,
                                          const PlainModel& model,
                                          double loss,
                                          PlainNormal* normal) {
  const double squared_loss = loss * loss;
  Lanes sums[kProducts + kUnknowns + 1] = {};
  for (int k = 0; k < pairs.padded_size(); k += kLanes) {
    const Terms terms = EpipolarTerms<kWeighted>(pairs, model, k);
    // ratio = loss^2 / (loss^2 + e^2 / D), with one division for it and for 1 / D.
    const Lanes robust = squared_loss * terms.D + terms.e * terms.e;
    const Lanes inverse_both = 1.0 / (terms.D * robust);
    const Lanes inverse_variance = inverse_both * robust;
    const Lanes ratio = inverse_both * squared_loss * terms.D * terms.D;
    const Lanes weight = ratio * ratio * inverse_variance;
    // r = e / sqrt(D): dr = (de - (e / D) dD / 2) / sqrt(D).
    const Lanes share = terms.e * inverse_variance;
    const Lanes along = Dot(terms.g, terms.f);
    Lanes3 d_rotation;   // de - share dD / 2
    Lanes3 d_direction;  // the same, but for a multiple of t
    if constexpr (kWeighted) {
      const Lanes toward = share * Dot(terms.g, terms.noise) - along;
      const Lanes3 g_cross_noise = Cross(terms.g, terms.noise);
      const Lanes along_f = share * terms.variance_i * terms.along_j;
      d_rotation.x = terms.along_i * (terms.f.x - share * terms.noise.x) + toward * model.t[0];
      d_rotation.y = terms.along_i * (terms.f.y - share * terms.noise.y) + toward * model.t[1];
      d_rotation.z = terms.along_i * (terms.f.z - share * terms.noise.z) + toward * model.t[2];
      d_direction.x = terms.n.x + along_f * terms.f.x - share * g_cross_noise.x;
      d_direction.y = terms.n.y + along_f * terms.f.y - share * g_cross_noise.y;
      d_direction.z = terms.n.z + along_f * terms.f.z - share * g_cross_noise.z;
    } else {
      // C_j = I and variance_i = 1: dD / 2 = (t . g) (t x g) and -((t . g) g + (t . f) f).
      const Lanes3 t_cross_g = Cross(model.t, terms.g);
      d_rotation.x = terms.along_i * (terms.f.x - share * t_cross_g.x) - along * model.t[0];
      d_rotation.y = terms.along_i * (terms.f.y - share * t_cross_g.y) - along * model.t[1];
      d_rotation.z = terms.along_i * (terms.f.z - share * t_cross_g.z) - along * model.t[2];
      d_direction.x = terms.n.x + share * (terms.along_i * terms.g.x + terms.along_j * terms.f.x);
      d_direction.y = terms.n.y + share * (terms.along_i * terms.g.y + terms.along_j * terms.f.y);
      d_direction.z = terms.n.z + share * (terms.along_i * terms.g.z + terms.along_j * terms.f.z);
    }
    const Lanes J[kUnknowns] = {d_rotation.x,
                                d_rotation.y,
                                d_rotation.z,
                                Dot(model.u, d_direction),
                                Dot(model.v, d_direction)};
    int index = 0;
    for (int row = 0; row < kUnknowns; ++row) {
      const Lanes weighted = weight * J[row];
      for (int column = row; column < kUnknowns; ++column) sums[index++] += weighted * J[column];
      sums[kProducts + row] += weighted * terms.e;
    }
    sums[kProducts + kUnknowns] += terms.e * share * ratio;
  }
  for (int k = 0; k <= kProducts + kUnknowns; ++k) normal->sums[k] = Sum(sums[k]);
}

// Upper triangle of H and the gradient.
struct PlainRotationNormal {
  double sums[9];
};

template <bool kWeighted>
ROTSLAM_INLINE void LinearizeRotationLoop(const PairArrays& pairs,
                                          const PlainModel& model,
                                          double loss,
                                          PlainRotationNormal* normal) {
  const double squared_loss = loss * loss;
  Lanes sums[9] = {};
  for (int k = 0; k < pairs.padded_size(); k += kLanes) {
    const Lanes3 g = Rotate(model.R, Load3(pairs, PairArrays::kBearingI, k));
    const Lanes3 f = Load3(pairs, PairArrays::kBearingJ, k);
    const Lanes3 residual = {g.x - f.x, g.y - f.y, g.z - f.z};
    // A rotation w moves g by w x g, so J^T y = g x y.
    if constexpr (kWeighted) {
      const LanesSymmetric3 W = LoadSymmetric3(pairs, PairArrays::kInformation, k);
      const Lanes3 weighted_residual = Times(W, residual);
      const Lanes ratio = squared_loss / (squared_loss + Dot(residual, weighted_residual));
      const Lanes weight = ratio * ratio;
      // Columns of J are the axes times g.
      const Lanes zero = {};
      const Lanes3 J_x = {zero, -g.z, g.y};
      const Lanes3 J_y = {g.z, zero, -g.x};
      const Lanes3 J_z = {-g.y, g.x, zero};
      const Lanes3 weighted_x = Times(W, J_x);
      const Lanes3 weighted_y = Times(W, J_y);
      const Lanes3 weighted_z = Times(W, J_z);
      sums[0] += weight * Dot(J_x, weighted_x);
      sums[1] += weight * Dot(J_x, weighted_y);
      sums[2] += weight * Dot(J_x, weighted_z);
      sums[3] += weight * Dot(J_y, weighted_y);
      sums[4] += weight * Dot(J_y, weighted_z);
      sums[5] += weight * Dot(J_z, weighted_z);
      const Lanes3 gradient = Cross(g, weighted_residual);
      sums[6] += weight * gradient.x;
      sums[7] += weight * gradient.y;
      sums[8] += weight * gradient.z;
    } else {
      const Lanes ratio = squared_loss / (squared_loss + Dot(residual, residual));
      const Lanes weight = ratio * ratio;
      // J^T J = |g|^2 I - g g^T; the square makes the padding count nothing.
      const Lanes xx = g.x * g.x;
      const Lanes yy = g.y * g.y;
      const Lanes zz = g.z * g.z;
      sums[0] += weight * (yy + zz);
      sums[1] -= weight * g.x * g.y;
      sums[2] -= weight * g.x * g.z;
      sums[3] += weight * (xx + zz);
      sums[4] -= weight * g.y * g.z;
      sums[5] += weight * (xx + yy);
      const Lanes3 gradient = Cross(g, residual);
      sums[6] += weight * gradient.x;
      sums[7] += weight * gradient.y;
      sums[8] += weight * gradient.z;
    }
  }
  for (int k = 0; k < 9; ++k) normal->sums[k] = Sum(sums[k]);
}

struct ScoreScales {
  double squared_threshold = 0.0;
  double inverse_squared_finest = 0.0;
  double limit = 0.0;
};

template <bool kWeighted>
ROTSLAM_INLINE HypothesisScore ScoreEpipolarLoop(const PairArrays& pairs,
                                                 const PlainModel& model,
                                                 const ScoreScales& scales) {
  const double outlier = 1.0 + scales.squared_threshold * scales.inverse_squared_finest;
  // Logarithms are slow: one is taken of the product of a block. No factor exceeds `outlier`, so
  // that the product stays below the largest double.
  constexpr double kLargestLog = 600.0;
  constexpr int kMaxSteps = 16;
  const double steps = kLargestLog / (kLanes * std::log(outlier) + 1e-300);
  const int block = kLanes * std::max(1, static_cast<int>(std::min<double>(steps, kMaxSteps)));
  HypothesisScore result;
  // The padding counts as outliers; their cost is subtracted here.
  result.score = (pairs.size() - pairs.padded_size()) * std::log(outlier);
  double count = 0.0;
  for (int begin = 0; begin < pairs.padded_size(); begin += block) {
    const int end = std::min(begin + block, pairs.padded_size());
    Lanes product = Lanes{} + 1.0;
    Lanes inliers = {};
    for (int k = begin; k < end; k += kLanes) {
      const Terms terms = EpipolarTerms<kWeighted>(pairs, model, k);
      const Lanes squared = terms.e * terms.e / terms.D;
      const Lanes along = Dot(terms.g, terms.f);
      const auto inlier = (squared < scales.squared_threshold) & (along > 0.0);
      const Lanes factor = 1.0 + squared * scales.inverse_squared_finest;
      product *= inlier ? factor : Lanes{} + outlier;
      inliers += inlier ? Lanes{} + 1.0 : Lanes{};
    }
    double factors = 1.0;
    for (int lane = 0; lane < kLanes; ++lane) factors *= product[lane];
    result.score += std::log(factors);
    count += Sum(inliers);
    if (result.score >= scales.limit) break;
  }
  result.num_inliers = static_cast<int>(count);
  return result;
}

template <bool kWeighted>
ROTSLAM_INLINE void SquaredDistancesLoop(const PairArrays& pairs,
                                         const PlainModel& model,
                                         double* squared_distances) {
  const Lanes infinite = Lanes{} + std::numeric_limits<double>::infinity();
  for (int k = 0; k < pairs.padded_size(); k += kLanes) {
    const Terms terms = EpipolarTerms<kWeighted>(pairs, model, k);
    const Lanes along = Dot(terms.g, terms.f);
    const Lanes squared = along > 0.0 ? terms.e * terms.e / terms.D : infinite;
    std::memcpy(squared_distances + k, &squared, sizeof squared);
  }
}

template <bool kWeighted>
ROTSLAM_INLINE void SquaredFlowsLoop(const PairArrays& pairs,
                                     const PlainModel& model,
                                     double* squared_flows) {
  for (int k = 0; k < pairs.padded_size(); k += kLanes) {
    const Lanes3 g = Rotate(model.R, Load3(pairs, PairArrays::kBearingI, k));
    const Lanes3 f = Load3(pairs, PairArrays::kBearingJ, k);
    const Lanes3 residual = {g.x - f.x, g.y - f.y, g.z - f.z};
    Lanes squared;
    if constexpr (kWeighted) {
      const LanesSymmetric3 W = LoadSymmetric3(pairs, PairArrays::kInformation, k);
      squared = Dot(residual, Times(W, residual));
    } else {
      squared = Dot(residual, residual);
    }
    std::memcpy(squared_flows + k, &squared, sizeof squared);
  }
}

// Every loop, once for all machines and once for those with AVX2.

ROTSLAM_INLINE void LinearizeEpipolarAny(const PairArrays& pairs,
                                         const PlainModel& model,
                                         double loss,
                                         PlainNormal* normal) {
  pairs.weighted() ? LinearizeEpipolarLoop<true>(pairs, model, loss, normal)
                   : LinearizeEpipolarLoop<false>(pairs, model, loss, normal);
}

ROTSLAM_INLINE void LinearizeRotationAny(const PairArrays& pairs,
                                         const PlainModel& model,
                                         double loss,
                                         PlainRotationNormal* normal) {
  pairs.weighted() ? LinearizeRotationLoop<true>(pairs, model, loss, normal)
                   : LinearizeRotationLoop<false>(pairs, model, loss, normal);
}

ROTSLAM_INLINE HypothesisScore ScoreEpipolarAny(const PairArrays& pairs,
                                                const PlainModel& model,
                                                const ScoreScales& scales) {
  return pairs.weighted() ? ScoreEpipolarLoop<true>(pairs, model, scales)
                          : ScoreEpipolarLoop<false>(pairs, model, scales);
}

ROTSLAM_INLINE void SquaredDistancesAny(const PairArrays& pairs,
                                        const PlainModel& model,
                                        double* squared) {
  pairs.weighted() ? SquaredDistancesLoop<true>(pairs, model, squared)
                   : SquaredDistancesLoop<false>(pairs, model, squared);
}

ROTSLAM_INLINE void SquaredFlowsAny(const PairArrays& pairs,
                                    const PlainModel& model,
                                    double* squared) {
  pairs.weighted() ? SquaredFlowsLoop<true>(pairs, model, squared)
                   : SquaredFlowsLoop<false>(pairs, model, squared);
}

struct PlainLoops {
  static void LinearizeEpipolar(const PairArrays& pairs,
                                const PlainModel& model,
                                double loss,
                                PlainNormal* normal) {
    LinearizeEpipolarAny(pairs, model, loss, normal);
  }
  static void LinearizeRotation(const PairArrays& pairs,
                                const PlainModel& model,
                                double loss,
                                PlainRotationNormal* normal) {
    LinearizeRotationAny(pairs, model, loss, normal);
  }
  static HypothesisScore ScoreEpipolar(const PairArrays& pairs,
                                       const PlainModel& model,
                                       const ScoreScales& scales) {
    return ScoreEpipolarAny(pairs, model, scales);
  }
  static void SquaredDistances(const PairArrays& pairs, const PlainModel& model, double* squared) {
    SquaredDistancesAny(pairs, model, squared);
  }
  static void SquaredFlows(const PairArrays& pairs, const PlainModel& model, double* squared) {
    SquaredFlowsAny(pairs, model, squared);
  }
};

#if ROTSLAM_HAS_AVX2_VARIANT
struct Avx2Loops {
  ROTSLAM_AVX2 static void LinearizeEpipolar(const PairArrays& pairs,
                                             const PlainModel& model,
                                             double loss,
                                             PlainNormal* normal) {
    LinearizeEpipolarAny(pairs, model, loss, normal);
  }
  ROTSLAM_AVX2 static void LinearizeRotation(const PairArrays& pairs,
                                             const PlainModel& model,
                                             double loss,
                                             PlainRotationNormal* normal) {
    LinearizeRotationAny(pairs, model, loss, normal);
  }
  ROTSLAM_AVX2 static HypothesisScore ScoreEpipolar(const PairArrays& pairs,
                                                    const PlainModel& model,
                                                    const ScoreScales& scales) {
    return ScoreEpipolarAny(pairs, model, scales);
  }
  ROTSLAM_AVX2 static void SquaredDistances(const PairArrays& pairs,
                                            const PlainModel& model,
                                            double* squared) {
    SquaredDistancesAny(pairs, model, squared);
  }
  ROTSLAM_AVX2 static void SquaredFlows(const PairArrays& pairs,
                                        const PlainModel& model,
                                        double* squared) {
    SquaredFlowsAny(pairs, model, squared);
  }
};
#endif

// Calls `function` with the loops that this machine runs fastest.
template <class Function>
auto WithBestLoops(const Function& function) {
#if ROTSLAM_HAS_AVX2_VARIANT
  static const bool kHasAvx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  if (kHasAvx2) return function(Avx2Loops{});
#endif
  return function(PlainLoops{});
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
      MutableRow(kBearingI + axis)[k] = pair.bearing_i[axis];
      MutableRow(kBearingJ + axis)[k] = pair.bearing_j[axis];
    }
    if (!weighted) continue;
    const MatchNoise noise = pair.noise.value_or(MatchNoise{});
    const Eigen::Matrix<double, 3, 2> basis = TangentBasis(pair.bearing_j);
    const Eigen::Matrix3d along = pair.bearing_j * pair.bearing_j.transpose();
    set_symmetric(kCovarianceJ, k, along + basis * noise.covariance_j * basis.transpose());
    MutableRow(kVarianceI)[k] = noise.variance_i;
    // A small constant keeps the weight of a match with zero covariance finite.
    Eigen::Matrix2d mean = 0.5 * noise.covariance_j;
    mean.diagonal().array() += 0.5 * noise.variance_i + 1e-6;
    set_symmetric(kInformation, k, along + basis * mean.inverse() * basis.transpose());
  }
}

PairArrays::PairArrays(const PairArrays& all, std::span<const int> indices) {
  Allocate(static_cast<int>(indices.size()), all.weighted());
  const int num_rows = weighted_ ? kWeightedRows : kNominalRows;
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
  return {row(kBearingI)[index], row(kBearingI + 1)[index], row(kBearingI + 2)[index]};
}

Eigen::Vector3d PairArrays::BearingJ(int index) const {
  return {row(kBearingJ)[index], row(kBearingJ + 1)[index], row(kBearingJ + 2)[index]};
}

void PairArrays::Allocate(int size, bool weighted) {
  size_ = size;
  weighted_ = weighted;
  padded_size_ = (size + kLanes - 1) / kLanes * kLanes;
  const int num_rows = weighted ? kWeightedRows : kNominalRows;
  data_.assign(std::size_t(num_rows) * std::size_t(padded_size_), 0.0);
}

EpipolarNormal LinearizeEpipolar(const PairArrays& pairs, const EpipolarModel& model, double loss) {
  PlainNormal plain;
  const PlainModel plain_model = Plain(model);
  WithBestLoops([&](auto loops) { loops.LinearizeEpipolar(pairs, plain_model, loss, &plain); });
  EpipolarNormal normal;
  int index = 0;
  for (int row = 0; row < kUnknowns; ++row) {
    for (int column = row; column < kUnknowns; ++column) {
      normal.H(row, column) = normal.H(column, row) = plain.sums[index++];
    }
    normal.gradient[row] = plain.sums[kProducts + row];
  }
  normal.cost = plain.sums[kProducts + kUnknowns];
  return normal;
}

RotationNormal LinearizeRotation(const PairArrays& pairs, const Rotation& j_from_i, double loss) {
  PlainRotationNormal plain;
  const PlainModel plain_model = Plain({j_from_i, Eigen::Vector3d::UnitX()});
  WithBestLoops([&](auto loops) { loops.LinearizeRotation(pairs, plain_model, loss, &plain); });
  RotationNormal normal;
  const double* sums = plain.sums;
  normal.H << sums[0], sums[1], sums[2], sums[1], sums[3], sums[4], sums[2], sums[4], sums[5];
  normal.gradient << sums[6], sums[7], sums[8];
  return normal;
}

HypothesisScore ScoreEpipolar(const PairArrays& pairs,
                              const EpipolarModel& model,
                              double threshold,
                              double finest,
                              double limit) {
  const ScoreScales scales{threshold * threshold, 1.0 / (finest * finest), limit};
  const PlainModel plain_model = Plain(model);
  return WithBestLoops([&](auto loops) { return loops.ScoreEpipolar(pairs, plain_model, scales); });
}

std::vector<double> SquaredDistances(const PairArrays& pairs, const EpipolarModel& model) {
  std::vector<double> squared(pairs.padded_size());
  const PlainModel plain_model = Plain(model);
  WithBestLoops([&](auto loops) { loops.SquaredDistances(pairs, plain_model, squared.data()); });
  squared.resize(pairs.size());
  return squared;
}

std::vector<double> SquaredFlows(const PairArrays& pairs, const Rotation& j_from_i) {
  std::vector<double> squared(pairs.padded_size());
  const PlainModel plain_model = Plain({j_from_i, Eigen::Vector3d::UnitX()});
  WithBestLoops([&](auto loops) { loops.SquaredFlows(pairs, plain_model, squared.data()); });
  squared.resize(pairs.size());
  return squared;
}

}  // namespace rotslam
