#pragma once

#include <span>
#include <vector>

#include "rotodom/types/rotation.h"

namespace rotslam {

/// What the orientation of a view may be by its matches with another one.
struct OrientationHypothesis {
  Rotation cam_from_world;
  double excess = 0.0;  // as in RelativeRotationEstimate
};

/// One pair of views' hypotheses, one at least.
struct PairHypotheses {
  std::vector<OrientationHypothesis> hypotheses;
  double weight = 1.0;  // of the pair's word among the others'
};

/// Chooses a hypothesis of each pair so that they agree best on the orientation of the view that
/// all pairs have in common. Where two views see little but a plane, two motions fit their matches;
/// the right ones of several pairs agree, the wrong ones do not.
///
/// Of all orientations that a hypothesis names, the one counts whose cost is least: the sum over
/// pairs of weight * min_h (a^2 / (1 + a^2) + excess_h), a the angle to hypothesis h in degrees,
/// about what edges across seconds are wrong by.
/// @return  positions of the chosen hypotheses, one per pair. One pair alone, or two that cannot
///          agree, keep the one with the least excess.
/// Cost:    quadratic in the number of hypotheses.
std::vector<int> ChooseConsistent(std::span<const PairHypotheses> pairs);

}  // namespace rotslam
