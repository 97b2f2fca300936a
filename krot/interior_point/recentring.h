#pragma once

#include <algorithm>
#include <utility>

#include "krot/structure/half_spaces.h"

namespace rotslam {

/// Largest step lengths of an interior-point method within the positive orthant.
struct Reach {
  double primal = 0.0;
  double dual = 0.0;
};

/// Share of the distance to the boundary that a step uses.
inline constexpr double kShareOfReach = 0.99;

/// Change that moves one row's product of slack and multiplier into [0.1 mu, 10 mu].
/// Source: Gondzio, "Multiple centrality corrections in a primal-dual method for linear
/// programming", Comput. Optim. Appl. 6, 1996.
inline Five Recentred(const Five& product, double mu) {
  constexpr double kLow = 0.1;
  constexpr double kHigh = 10.0;
  return (product.max(kLow * mu).min(kHigh * mu) - product).max(-kHigh * mu);
}

/// Recentres a step while that increases its length, at most `max_times`; Gondzio 1996.
/// @param reach_of   computes the Reach of a step.
/// @param recentred  computes, from a step and an aim, the step with the products recentred at its
///                   end when it is scaled to `aim`, which is beyond its reach.
template <typename Step, typename ReachOf, typename RecentredStep>
std::pair<Step, Reach> Lengthened(Step step,
                                  int max_times,
                                  const ReachOf& reach_of,
                                  const RecentredStep& recentred) {
  constexpr double kLongEnough = 0.9;   // of a full step
  constexpr double kFurther = 0.3;      // of the aim beyond the reach
  constexpr double kWorthwhile = 0.05;  // smallest gain in length that pays for a solve
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
