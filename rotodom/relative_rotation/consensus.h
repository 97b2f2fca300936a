#pragma once

#include <cstdint>
#include <vector>

#include "rotodom/relative_rotation/pair_arrays.h"
#include "rotodom/relative_rotation/relative_rotation.h"

namespace rotslam {

/// The epipolar model that most matches agree on.
struct Consensus {
  EpipolarModel model;
  int num_inliers = 0;
  // Positions of the pairs, right and wrong ones, among which agreement is not by chance;
  // ascending.
  std::vector<int> members;
  int num_samples = 0;
};

/// Searches for the model with the best score over all pairs: ScoreEpipolar with the epipolar lines
/// ended where points would be behind the cameras.
///
/// With little parallax the epipolar distance has several minima, a rotation traded for a
/// translation. So the search descends from the prediction and from the rotation that aligns the
/// bearings best, each with every principal direction of the flow, and then from small samples.
/// Descents run on a part of the pairs, so that their cost does not depend on the number of pairs.
/// @param predicted_j_from_i  where to start; may be far off.
/// @param focal_px            pixels per radian, for the thresholds.
/// @return  num_inliers within options.inlier_px, possibly too few to mean anything.
Consensus FindConsensus(const PairArrays& pairs,
                        const Rotation& predicted_j_from_i,
                        double focal_px,
                        const RelativeRotationOptions& options,
                        std::uint64_t seed);

}  // namespace rotslam
