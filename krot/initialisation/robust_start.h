#pragma once

#include <optional>
#include <string>
#include <vector>

#include "krot/structure/minimax_lp.h"
#include "krot/structure/minimax_problem.h"

namespace rotslam {

/// Of the start that survives outliers.
struct RobustStartOptions {
  // "interior": our own interior-point programs, the LP engine where they do not converge.
  // "programs": the LP engine alone, two to four times the time of the whole known-rotation stage.
  std::string method = "interior";
  // Linear programs at most. The first is plain L1, each later one lowers the price of what the one
  // before called an outlier. With 10 % uniform outliers three rounds lose below 1 % of the
  // inliers, one round 30 % (RobustStart tests); without outliers the first round ends it.
  int max_rounds = 3;
  // Price of missing the smallest depth by one, over that of missing a pixel bound by one at depth
  // one. Large enough that structures do not collapse to buy off outliers.
  double depth_price = 10.0;
  // A last program with the bound zero, outliers still priced down: plain L1, which picks the
  // likeliest structure from inside the tube that the rounds leave open. Takes the centres' error
  // over a street of 60 m from 0.3..1.3 m to 0.05..0.4 m (0 to 0.3 deg of rotation error, 0.7 px).
  bool use_sharpening = true;
  LpOptions lp;

  std::optional<std::string> Problem() const;

  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("method", method);
    visit("max_rounds", max_rounds);
    visit("depth_price", depth_price);
    visit("use_sharpening", use_sharpening);
  }
};

struct RobustStart {
  LpCallStatus call = LpCallStatus::kNotRun;
  MinimaxStructure structure;     // empty when the call failed
  std::vector<double> residuals;  // BoxResidual of every observation, normalised units
  int num_programs = 0;
};

/// Finds the structure with the least sum of slacks over the bound `gamma`. Outliers are
/// down-weighted in rounds by 1 / ((1 + (excess / gamma)^2) depth).
/// @param start  values of fixed views and points, required when the problem has any. Its smallest
///               depth must be well above one, and the method is then always "interior".
/// Source:  Candes, Wakin & Boyd, Enhancing sparsity by reweighted l1 minimization, 2008; ours
///          squares the excess and divides by depth, since slack is counted at depth, and ends
///          with one program without the bound.
/// Error:   truth to 1e-6 of the scene's size on clean scenes.
RobustStart SolveRobustStart(const MinimaxProblem& problem,
                             double gamma,
                             const RobustStartOptions& options = {},
                             const MinimaxStructure* start = nullptr);

}  // namespace rotslam
