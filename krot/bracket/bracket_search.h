#pragma once

#include "krot/bracket/bisection_options.h"
#include "krot/structure/minimax_problem.h"

namespace rotslam {

/// The bracket of one connected component of a problem, and the state of its search.
struct Bracket {
  BisectionStatus status = BisectionStatus::kSolverFailed;
  MinimaxStructure structure;
  double gamma_low = 0.0;
  double gamma_high = kInfinity;
  int num_programs = 0;
  int num_undecided = 0;
  int num_points_in_programs = 0;
};

/// When a search ends before its bracket is narrow.
struct SearchLimits {
  // The bracket need not be narrowed below this: another component has a larger residual.
  double gamma_of_others = 0.0;
  int max_programs = 0;
  bool only_feasible = false;  // any structure will do
};

/// MinimiseMaxResidual of one connected part by interior-point programs over a growing set of
/// points.
Bracket SearchBracket(const MinimaxProblem& problem,
                      const BisectionOptions& options,
                      const SearchLimits& limits,
                      const MinimaxStructure* start);

/// The same by the LP engine over all points, halving the bracket.
Bracket BisectPrograms(const MinimaxProblem& problem,
                       const BisectionOptions& options,
                       const SearchLimits& limits,
                       const MinimaxStructure* start);

/// The same where all observations are of one view: a point lies in the middle of its rays.
Bracket SearchSingleView(const MinimaxProblem& problem, const BisectionOptions& options);

/// The bracket is as narrow as asked, or too low to matter.
bool Narrow(const Bracket& bracket, const BisectionOptions& options, const SearchLimits& limits);

/// False when the caller's on_progress wants the search to end.
bool Continue(const BisectionOptions& options, const Bracket& bracket, int num_points);

/// Takes the structure where it is better than the bracket's.
void Offer(const MinimaxProblem& problem, MinimaxStructure structure, Bracket& bracket);

}  // namespace rotslam
