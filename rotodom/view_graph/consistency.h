#pragma once

#include <span>
#include <vector>

#include "rotodom/types/rotation.h"

namespace rotslam {

/// A candidate for the orientation of a view from its matches with another view.
struct OrientationHypothesis {
  Rotation cam_from_world;
  double excess = 0.0;  // as in RelativeRotationEstimate
};

/// The hypotheses of one pair of views, at least one.
struct PairHypotheses {
  std::vector<OrientationHypothesis> hypotheses;
  double weight = 1.0;  // of the pair
};

/// Selects one hypothesis of each pair such that they agree best on the orientation of the view
/// that all pairs have in common. Where two views see little but a plane, two motions fit their
/// matches. The right ones of several pairs agree, the wrong ones do not.
///
/// The orientation with the least cost among all hypotheses is chosen. The cost is the sum over
/// pairs of weight * min_h (a^2 / (1 + a^2) + excess_h), with a the angle to hypothesis h in
/// degrees; one degree is about the error of edges across seconds.
/// @return  indices of the chosen hypotheses, one per pair. A single pair, or two pairs without
///          agreement, keep the hypothesis with the least excess.
/// Cost:    quadratic in the number of hypotheses.
std::vector<int> ChooseConsistent(std::span<const PairHypotheses> pairs);

}  // namespace rotslam
