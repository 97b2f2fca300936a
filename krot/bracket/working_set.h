#pragma once

#include <vector>

#include "krot/structure/minimax_problem.h"

namespace rotslam {

/// Part of a problem with the names its views and points have there.
struct SubProblem {
  MinimaxProblem problem;
  std::vector<int> views;
  std::vector<int> points;
};

/// Parts that share no view, those with most points first. Points of one observation, which fit
/// anything, and views that see no other points stand in none.
std::vector<SubProblem> ConnectedParts(const MinimaxProblem& problem);

/// The chosen points with all their observations; every view stays.
SubProblem RestrictToPoints(const MinimaxProblem& problem, const std::vector<bool>& chosen);

/// Points that cover every view's image evenly, long tracks first, about `points_per_view` in each
/// view, joined to one part where the problem is one.
std::vector<bool> SpreadPoints(const MinimaxProblem& problem, int points_per_view);

/// Adds to `chosen`, for every view, the `per_view` points with the largest residuals above
/// `limit`. Returns how many were added.
/// @param residuals  largest residual of each point.
int AddWorstPoints(const MinimaxProblem& problem,
                   const std::vector<double>& residuals,
                   double limit,
                   int per_view,
                   std::vector<bool>& chosen);

}  // namespace rotslam
