#pragma once

#include <algorithm>
#include <utility>

#include "krot/structure/half_spaces.h"

namespace rotslam {

/// How far a step of an interior point method can go without leaving the positive orthant.
struct Reach {
  double primal = 0.0;
  double dual = 0.0;
};

/// Goes not quite to the boundary.
inline constexpr double kShareOfReach = 0.99;

/// What moves one row's product of slack and multiplier towards `mu`.
/// Source: Gondzio, "Multiple centrality corrections in a primal-dual method for linear
/// programming", Comput. Optim. Appl. 6, 1996.
inline Five Recentred(const Five& product, double mu) {
  constexpr double kLow = 0.1;
  constexpr double kHigh = 10.0;
  return (product.max(kLow * mu).min(kHigh * mu) - product).max(-kHigh * mu);
}

/// Recentres a step while that lengthens it, at most `max_times`; Gondzio 1996.
/// @param reach_of   Reach of a step.
/// @param recentred  (step, aim): the step with the products recentred where it ends when made as
///                   long as `aim`, somewhat further than it can go.
template <typename Step, typename ReachOf, typename RecentredStep>
std::pair<Step, Reach> Lengthened(Step step,
                                  int max_times,
                                  const ReachOf& reach_of,
                                  const RecentredStep& recentred) {
  constexpr double kLongEnough = 0.9;
  constexpr double kFurther = 0.3;
  constexpr double kWorthwhile = 0.05;
  Reach reach = reach_of(step);
  for (int k = 0; k < max_times && std::min(reach.primal, reach.dual) < kLongEnough; ++k) {
    const Reach aim{std::min(1.0, reach.primal + kFurther), std::min(1.0, reach.dual + kFurther)};
    Step trial = recentred(step, aim);
    const Reach further = reach_of(trial);
    if (!(further.primal + further.dual >= reach.primal + reach.dual + kWorthwhile)) break;
    step = std::move(trial);
    reach = further;
  }
  return {std::move(step), reach};
}

}  // namespace rotslam
