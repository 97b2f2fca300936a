#pragma once

#include <algorithm>
#include <cstddef>
#include <utility>
#include <vector>

#include "krot/structure/half_spaces.h"

namespace rotslam {

// The step rule that the interior-point methods share: Mehrotra's centring, Gondzio's recentring,
// and steps that stay inside. `Rows` is an array of the slacks or multipliers of one observation.

/// Largest step lengths of an interior-point method within the positive orthant.
struct Reach {
  double primal = 0.0;
  double dual = 0.0;
};

/// Share of the distance to the boundary that a step uses.
inline constexpr double kShareOfReach = 0.99;

/// Largest step in [0, 1] along `step` that keeps all entries of `value` positive.
template <typename Rows>
double StepToBoundary(const std::vector<Rows>& value, const std::vector<Rows>& step) {
  double length = 1.0;
  for (std::size_t o = 0; o < value.size(); ++o) {
    // Divisions are needed only for values that would become negative.
    if ((value[o] + length * step[o] >= 0.0).all()) continue;
    for (int k = 0; k < value[o].size(); ++k) {
      if (step[o][k] < 0.0) length = std::min(length, -value[o][k] / step[o][k]);
    }
  }
  return length;
}

/// Reach of a step of an iterate's slacks r and multipliers y.
template <typename Rows>
Reach ReachOf(const std::vector<Rows>& r,
              const std::vector<Rows>& dr,
              const std::vector<Rows>& y,
              const std::vector<Rows>& dy) {
  return {StepToBoundary(r, dr), StepToBoundary(y, dy)};
}

/// Sum of the products of slacks and multipliers after steps of that length.
template <typename Rows>
double ProductsAfter(const std::vector<Rows>& r,
                     const std::vector<Rows>& dr,
                     const std::vector<Rows>& y,
                     const std::vector<Rows>& dy,
                     const Reach& length) {
  double sum = 0.0;
  for (std::size_t o = 0; o < r.size(); ++o) {
    sum += ((r[o] + length.primal * dr[o]) * (y[o] + length.dual * dy[o])).sum();
  }
  return sum;
}

/// Product that the corrector aims at.
/// @param share  of the mean product `mu`: a power of what the predictor leaves of it.
inline double TargetProduct(double share, double mu) { return std::clamp(share, 1e-6, 1.0) * mu; }

/// Slacks computed anew after a step of that length, of which rounding must make none negative.
template <typename Rows>
Rows KeptPositive(const Rows& r, const Rows& before, const Rows& step, double length) {
  return r.max(1e-3 * before.min(before + length * step));
}

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
