#pragma once

#include <cstdint>
#include <vector>

#include "rotodom/relative_rotation/pair_arrays.h"
#include "rotodom/relative_rotation/relative_rotation.h"

namespace rotslam {

/// No match is believed to be better than this, however well the matches agree: patches are aligned
/// to 0.03 px on clean images (TrackPoints).
inline constexpr double kMinNoisePx = 0.02;
/// Scale of the redescending (Geman-McClure) loss in refinements, in standard deviations of the
/// noise that the matches show: 3 in 1,000 right matches err by more.
inline constexpr double kLossSigmas = 3.0;

/// An epipolar model that many matches agree on.
struct Consensus {
  EpipolarModel model;
  int num_inliers = 0;
  // What its score lacks to the best model's, by inlier of that one; zero for the best itself.
  double excess = 0.0;
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
/// bearings best, each with every principal direction of the flow, then from small samples, and at
/// last from the other motion that shows a plane in the same places (PlanarAmbiguity).
/// Descents run on a part of the pairs, so that their cost does not depend on the number of pairs.
/// @param predicted_j_from_i  where to start; may be far off.
/// @param focal_px            pixels per radian, for the thresholds.
/// @return  the best model, and behind it the best of those minima whose rotation is another one
///          (2 deg) and whose score is at most 0.25 by inlier worse. A twin comes first only if its
///          score is better by more than that: wrong matches and noise that neighbours share decide
///          between such two, not the motion. num_inliers within options.inlier_px, possibly too
///          few to mean anything.
std::vector<Consensus> FindConsensus(const PairArrays& pairs,
                                     const Rotation& predicted_j_from_i,
                                     double focal_px,
                                     const RelativeRotationOptions& options,
                                     std::uint64_t seed);

}  // namespace rotslam
