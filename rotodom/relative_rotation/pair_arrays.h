#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include "rotodom/relative_rotation/bearing_pair.h"
#include "rotodom/relative_rotation/pair_loops.h"
#include "rotodom/types/rotation.h"

namespace rotslam {

/// Rotation and direction of translation between two views: x_j = R x_i + s t. The sign of the
/// direction has no meaning here.
struct EpipolarModel {
  Rotation j_from_i;
  Eigen::Vector3d direction = Eigen::Vector3d::UnitX();  // unit
};

/// Bearing pairs with one array per coordinate, for vectorised loops. Immutable.
class PairArrays {
 public:
  PairArrays() = default;
  explicit PairArrays(std::span<const BearingPair> pairs);
  /// Copies some of the pairs, in the order of `indices`.
  PairArrays(const PairArrays& all, std::span<const int> indices);

  /// About `count` of the pairs, evenly spread over their order.
  PairArrays Thinned(int count) const;

  int size() const { return size_; }
  /// Whether any pair has a MatchNoise; nominal pairs then have explicit covariances, too.
  bool weighted() const { return weighted_; }
  /// Length of an array: size() rounded up to a multiple of kLanes; the rest is zero.
  int padded_size() const { return padded_size_; }
  /// Coordinate `row` of all pairs, see PairRows::Row.
  const double* row(int row) const { return data_.data() + std::ptrdiff_t{row} * padded_size_; }

  Eigen::Vector3d BearingI(int index) const;
  Eigen::Vector3d BearingJ(int index) const;

  static constexpr int kLanes = PairRows::kLanes;
  PairRows rows() const { return {data_.data(), padded_size_, size_, weighted_}; }

 private:
  void Allocate(int size, bool weighted);
  double* MutableRow(int row) { return data_.data() + std::ptrdiff_t{row} * padded_size_; }

  int size_ = 0;
  int padded_size_ = 0;
  bool weighted_ = false;
  std::vector<double> data_;
};

/// Normal equations of the robust Sampson distances.
struct EpipolarNormal {
  Eigen::Matrix<double, 5, 5> H;         // rotation (left, rad), direction (along TangentBasis)
  Eigen::Matrix<double, 5, 1> gradient;  // half of the cost's
  double cost = 0.0;                     // sum of loss^2 r^2 / (loss^2 + r^2), Geman-McClure
};

/// Normal equations of the robust differences R f_i - f_j.
struct RotationNormal {
  Eigen::Matrix3d H;
  Eigen::Vector3d gradient;
};

/// Score of a hypothesis.
struct HypothesisScore {
  double score = 0.0;   // smaller is better
  int num_inliers = 0;  // complete only when the score stayed below the limit
};

/// Bounds of the distances that a score counts, rad.
struct ScoreBounds {
  double threshold = 0.0;  // of an inlier
  double finest = 0.0;     // below this all distances are alike
};

// The loops over all pairs (PairLoops).
//
// The Sampson distance of a pair is r = t . (g x f) / sqrt(D), g = R f_i, f = f_j, where D is the
// variance of the numerator for nominal noise (Muhle et al., The Probabilistic Normal Epipolar
// Constraint, CVPR 2022): D = v_i |t x f|^2 + (t x g)^T C_j (t x g) + a floor near the epipole,
// where the distance has no meaning. It is in radians of a nominal match.

EpipolarNormal LinearizeEpipolar(const PairArrays& pairs, const EpipolarModel& model, double loss);

RotationNormal LinearizeRotation(const PairArrays& pairs, const Rotation& j_from_i, double loss);

/// Sum of log(1 + r^2 / finest^2), truncated at the threshold. The score rises with the accuracy of
/// a match at every scale above `finest`, so that two models with the same inliers are ranked by
/// the noise of the matches, whatever its size. Stops once the sum reaches `limit`.
HypothesisScore ScoreEpipolar(const PairArrays& pairs,
                              const EpipolarModel& model,
                              const ScoreBounds& bounds,
                              double limit);

/// ScoreEpipolar with the distances to the epipolar half-lines, which hold the points in front of
/// both cameras, for the sign of the direction that fits better. A plane has two motions that fit
/// all its epipolar lines, but with the wrong one about half of it is behind the cameras.
/// @param squared_distances  of SquaredDistances, for the same model.
/// @param any_way            flow up to this length may have any direction, rad.
HypothesisScore ScoreHalfLines(const PairArrays& pairs,
                               const EpipolarModel& model,
                               std::vector<double> squared_distances,
                               const ScoreBounds& bounds,
                               double any_way);

/// Squared Sampson distances, size() of them; those of pairs that point in opposite directions are
/// infinite.
std::vector<double> SquaredDistances(const PairArrays& pairs, const EpipolarModel& model);

/// Squared lengths of R f_i - f_j, size() of them, each per nominal variance of one view.
std::vector<double> SquaredFlows(const PairArrays& pairs, const Rotation& j_from_i);

/// How many of the values are smaller than the limit.
std::ptrdiff_t CountBelow(std::span<const double> values, double limit);

}  // namespace rotslam
