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

/// Structure that misses the bound `gamma` by the least sum, outliers priced down in rounds by
/// 1 / ((1 + (excess / gamma)^2) depth).
/// Programs are our own interior-point ones; the LP engine solves those that do not converge.
/// @param start  where the problem's fixed views and points are, when it has any (its smallest
/// depth
///               must then be well above one): only interior-point programs hold them.
/// Source:  Candes, Wakin & Boyd, Enhancing sparsity by reweighted l1 minimization, 2008; ours
///          squares the excess and divides by depth, since slack is counted at depth, and ends
///          with one program without the bound.
/// Error:   truth to 1e-6 of the scene's size on clean scenes.
RobustStart SolveRobustStart(const MinimaxProblem& problem,
                             double gamma,
                             const MinimaxStructure* start = nullptr);

}  // namespace rotslam
