#pragma once

#include <vector>

#include "krot/structure/minimax_lp.h"
#include "krot/structure/minimax_problem.h"

namespace rotslam {

struct RobustStart {
  LpCallStatus call = LpCallStatus::kNotRun;
  MinimaxStructure structure;     // empty when the call failed
  std::vector<double> residuals;  // BoxResidual of every observation, normalised units
  int num_programs = 0;
};

/// Finds the structure with the least sum of slacks over the bound `gamma`. Outliers are
/// down-weighted in rounds by 1 / ((1 + (excess / gamma)^2) depth).
/// @param start  values of fixed views and points, required when the problem has any. Its smallest
///               depth must be well above one: only interior-point programs hold them.
/// Source:  Candes, Wakin & Boyd, Enhancing sparsity by reweighted l1 minimization, 2008; ours
///          squares the excess and divides by depth, since slack is counted at depth, and ends
///          with one program without the bound.
/// Error:   truth to 1e-6 of the scene's size on clean scenes.
RobustStart SolveRobustStart(const MinimaxProblem& problem,
                             double gamma,
                             const MinimaxStructure* start = nullptr);

}  // namespace rotslam
