#pragma once

#include "krot/structure/minimax_lp.h"
#include "krot/structure/minimax_problem.h"

namespace rotslam {

/// When an L1 program counts as solved.
struct L1InteriorOptions {
  // Ends when the gap between the program's bounds is below this share of the objective, or of what
  // missing one smallest depth costs.
  double tolerance = 1e-6;
  int max_iterations = 200;
  // Of every slack and its multiplier at the first iterate. A generous one makes the first steps
  // long; from the answer to much the same program a thousandth halves the iterations.
  double first_product = 10.0;
};

/// Solves the program of SolveL1Slack by a specialised interior-point method, which eliminates the
/// slacks and points and factors the centres' system.
/// @param start  first iterate and the values of fixed views and points; required when there are
///                 any. The bound of one on the smallest depth applies to its scale as well.
/// @return  kCompleted when the tolerance was reached. Multipliers are those of the last iterate.
///          Throws std::invalid_argument as SolveL1Slack does.
/// Cost:    20 to 60 iterations of a StructureSystem, up to 150 for some long paths, 10 to 20 from
///          a good start.
/// Source:  Mehrotra, On the implementation of a primal-dual interior point method, SIAM J. Opt.
///          1992, for variables with an upper bound.
MinimaxLpResult SolveL1SlackInterior(const L1SlackProgram& l1,
                                     const L1InteriorOptions& options = {},
                                     const MinimaxStructure* start = nullptr);

}  // namespace rotslam
