#pragma once

#include <cstddef>

namespace rotslam {

/// Rows of the arrays of PairArrays. A pair has the coordinates of its bearings and, where pairs
/// are weighted, the covariances of its match.
struct PairRows {
  // Pairs processed together; arrays are padded with zeros to multiples of it.
  static constexpr int kLanes = 8;
  enum Row {
    kBearingI = 0,                    // 3
    kBearingJ = 3,                    // 3
    kNominalRows = 6,                 // all there is unless weighted
    kCovarianceJ = kNominalRows,      // 6: upper triangle, 3x3, tangential block as given and 1
                                      // along the bearing, so that a nominal pair has I
    kVarianceI = kCovarianceJ + 6,    // 1
    kInformation = kVarianceI + 1,    // 6: upper triangle of the inverse of the mean of both views'
    kWeightedRows = kInformation + 6  //    covariances
  };

  const double* data;
  std::ptrdiff_t padded_size;  // length of an array
  int size;
  bool weighted;
};

/// An epipolar model in plain arrays.
struct PairModel {
  double R[9];  // row-major
  double t[3];
  double u[3];  // tangent basis of t
  double v[3];
};

/// Unknowns of an epipolar model: three of the rotation and two of the direction.
struct EpipolarSums {
  static constexpr int kUnknowns = 5;
  static constexpr int kProducts = kUnknowns * (kUnknowns + 1) / 2;
  double products[kProducts];  // of the unknowns' derivatives, upper triangle row by row
  double gradient[kUnknowns];
  double cost;
};

struct RotationSums {
  double products[6];  // upper triangle of H
  double gradient[3];
};

/// Bounds of the distances that a score counts.
struct ScoreLimits {
  double squared_threshold;
  double inverse_squared_finest;
  double any_way;  // flow up to this length may have any direction; for half-lines
  double limit;    // stops when the score reaches it; for lines
};

struct PairScore {
  double score;
  int num_inliers;
};

/// The loops over all pairs, compiled for one SimdLevel. All levels give the same results: sums run
/// in kLanes lanes that are added in the same order. See pair_arrays.h for their meaning.
struct PairLoops {
  void (*linearize_epipolar)(const PairRows*, const PairModel*, double loss, EpipolarSums*);
  void (*linearize_rotation)(const PairRows*, const PairModel*, double loss, RotationSums*);
  void (*score_lines)(const PairRows*, const PairModel*, const ScoreLimits*, PairScore*);
  /// Of the direction and of its opposite.
  void (*score_half_lines)(const PairRows*,
                           const PairModel*,
                           const double* squared_distances,
                           const ScoreLimits*,
                           PairScore*);
  /// Fill padded_size entries.
  void (*squared_distances)(const PairRows*, const PairModel*, double*);
  void (*squared_flows)(const PairRows*, const PairModel*, double*);
  std::ptrdiff_t (*count_below)(const double* values, std::ptrdiff_t count, double limit);
};

extern const PairLoops kPairLoopsBaseline;
extern const PairLoops kPairLoopsAvx2;
extern const PairLoops kPairLoopsAvx512;

}  // namespace rotslam
