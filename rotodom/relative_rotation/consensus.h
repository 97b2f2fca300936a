#pragma once

#include <cstdint>
#include <vector>

#include "rotodom/relative_rotation/pair_arrays.h"
#include "rotodom/relative_rotation/relative_rotation_options.h"

namespace rotslam {

/// No match is believed to be better than this, however well the matches agree: patches are aligned
/// to 0.03 px on clean images (TrackPoints).
inline constexpr double kMinNoisePx = 0.02;
/// Scale of the redescending (Geman-McClure) loss in refinements, in standard deviations of the
/// noise that the matches show: 3 in 1,000 right matches err by more.
inline constexpr double kLossSigmas = 3.0;

/// An epipolar model with its inliers.
struct Consensus {
  EpipolarModel model;
  int num_inliers = 0;
  // Difference of its score from that of the best model, per inlier of the latter; zero for the
  // best itself.
  double excess = 0.0;
  // Positions of the pairs, inliers and outliers, whose agreement is not by chance; ascending.
  std::vector<int> members;
  int num_samples = 0;
};

/// Searches for the model with the best score over all pairs: ScoreEpipolar, with the epipolar
/// lines ending where points would be behind the cameras.
///
/// With little parallax the epipolar distance has several minima, because rotation and translation
/// have similar effects. Descents therefore start from the prediction and from the rotation that
/// aligns the bearings best, each with every principal direction of the flow, then from small
/// samples, and finally from the second solution for a plane (PlanarAmbiguity). They use a part of
/// the pairs, so that their cost does not depend on the number of pairs.
/// @param predicted_j_from_i  where to start; may be far off.
/// @param focal_px            pixels per radian, for the thresholds.
/// @return  the best model, followed by the best other minimum whose rotation differs by more than
///          2 deg and whose score per inlier is worse by at most 0.25. The second solution for a
///          plane comes first only if its score is better by more than that: a smaller difference
///          is caused by outliers and shared errors. num_inliers counts pairs within
///          options.inlier_px and may be too small to be of use.
std::vector<Consensus> FindConsensus(const PairArrays& pairs,
                                     const Rotation& predicted_j_from_i,
                                     double focal_px,
                                     const RelativeRotationOptions& options,
                                     std::uint64_t seed);

/// Follows a known minimum after the pairs have changed a little: descents from `known` and from
/// the prediction instead of the search above.
/// @param known  its direction may be zero.
Consensus FollowConsensus(const PairArrays& pairs,
                          const EpipolarModel& known,
                          const Rotation& predicted_j_from_i,
                          double focal_px,
                          const RelativeRotationOptions& options);

}  // namespace rotslam
