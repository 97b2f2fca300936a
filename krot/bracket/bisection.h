#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "krot/structure/minimax_lp.h"
#include "krot/structure/minimax_problem.h"

namespace rotslam {

/// How far a search is.
struct BisectionProgress {
  double gamma_low = 0.0;
  double gamma_high = kInfinity;
  int num_programs = 0;
  int num_points = 0;  // in the program just solved
};

/// How closely the bisection brackets the optimum, and by which programs.
struct BisectionOptions {
  // "interior": our own interior-point programs over the few points that hold the optimum, the LP
  // engine where they stall. "programs": the LP engine alone, over all points; ten to a hundred
  // times the time and memory, and no code in common but the proofs.
  std::string method = "interior";
  // Stop when gamma_high - gamma_low <= relative_gap * gamma_high. 1e-2 is what a start for bundle
  // adjustment needs; the linear programs stop telling the sides apart near 1e-4.
  double relative_gap = 1e-2;
  // Linear programs at most, undecided ones included.
  int max_programs = 200;
  LpOptions lp;
  // Called after every program; false stops the search, which then returns what it has. Not called
  // when empty.
  std::function<bool(const BisectionProgress&)> on_progress;

  std::optional<std::string> Problem() const;

  // Not configuration: the members that are not visited; programs and tests set them.
  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("relative_gap", relative_gap);
    visit("max_programs", max_programs);
  }
};

enum class BisectionStatus {
  kConverged,       // the bracket is as narrow as asked
  kIterationLimit,  // max_programs solved, or both sides undecided; the bracket is still right
  kSolverFailed,    // no program gave a structure with positive depths
  kCancelled,       // on_progress said so; the bracket is still right
};

struct BisectionResult {
  BisectionStatus status = BisectionStatus::kSolverFailed;
  // Attains gamma_high; empty when gamma_high is infinite. Parts that share no view have a gauge
  // each: the first view's centre the origin, the smallest depth one.
  MinimaxStructure structure;
  // The least possible largest residual lies in [gamma_low, gamma_high], normalised units.
  // gamma_low is proven (CertifiesInfeasible), gamma_high attained.
  double gamma_low = 0.0;
  double gamma_high = kInfinity;
  // Positions in MinimaxProblem::observations with residuals within relative_gap of gamma_high.
  std::vector<int> active;
  int num_programs = 0;
  int num_undecided = 0;
  int num_points_in_programs = 0;  // of the last programs, summed over the parts
  double seconds = 0.0;
};

/// Finds the structure whose largest residual per image axis is smallest.
/// @param start  a first structure, when there is one: its MaxBoxResidual is the first upper bound.
/// @return  see BisectionResult. Throws std::invalid_argument when an option is out of range or
///          CheckProblem refuses the problem. A problem without two observations of a point is
///          solved exactly, by anything.
/// Cost:    20 to 70 programs over 2 to 10 % of the points, most of them a few interior-point steps
///          long, and the triangulation of the other points that miss. Gap 1e-2 on streets of 6.4
///          views a point, CPU s of one thread: 20 views and 1,000 points 0.05; 100 and 5,000 0.3;
///          200 and 20,000 0.8; 500 and 30,000 2 to 4.5; 1,000 and 100,000 15 (111 MB). 172 views
///          around 14,828 points 3 to 7. That is the observations to the power 1.2; gap 1e-3 takes
///          up to twice that.
/// Source:  Kahl & Hartley, Multiple-View Geometry under the L-infinity Norm, PAMI 2008; ours
///          bounds |dx| and |dy| apart, steps as Crouzeix, Ferland & Schaible instead of halving,
///          adds the observations that miss the bound, and accepts a lower bound only with a
///          checked certificate. A lower bound of some points holds for all.
BisectionResult MinimiseMaxResidual(const MinimaxProblem& problem,
                                    const BisectionOptions& options,
                                    const MinimaxStructure* start = nullptr);

}  // namespace rotslam
