#pragma once

#include <optional>
#include <string>
#include <vector>

#include "krot/minimax_lp.h"
#include "krot/minimax_problem.h"

namespace rotslam {

struct RobustStartOptions {
  // Linear programs at most. The first is plain L1, each later one lowers the price of what the one
  // before called an outlier. With 10 % uniform outliers three rounds lose below 1 % of the
  // inliers, one round 30 % (RobustStart tests); without outliers the first round ends it.
  int max_rounds = 3;
  // Price of missing the smallest depth by one, over that of missing a pixel bound by one at depth
  // one. Large enough that structures do not collapse to buy off outliers.
  double depth_price = 10.0;
  LpOptions lp;

  std::optional<std::string> Problem() const;

  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("max_rounds", max_rounds);
    visit("depth_price", depth_price);
  }
};

struct RobustStart {
  LpCallStatus call = LpCallStatus::kNotRun;
  MinimaxStructure structure;     // empty when the call failed
  std::vector<double> residuals;  // BoxResidual of every observation, normalised units
  int num_programs = 0;
};

/// Structure that misses the bound `gamma` by the least sum, outliers priced down in rounds by
/// 1 / ((1 + (excess / gamma)^2) depth).
/// Source:  Candes, Wakin & Boyd, Enhancing sparsity by reweighted l1 minimization, 2008; ours
///          squares the excess and divides by depth, since slack is counted at depth.
RobustStart SolveRobustStart(const MinimaxProblem& problem,
                             double gamma,
                             const RobustStartOptions& options = {});

}  // namespace rotslam
