#pragma once

#include <optional>
#include <string>

#include "krot/minimax_lp.h"
#include "krot/minimax_problem.h"

namespace rotslam {

struct BisectionOptions {
  // Stop when gamma_high - gamma_low <= relative_gap * gamma_high. 1e-2 is what a start for bundle
  // adjustment needs; the linear programs stop telling the sides apart near 1e-3.
  double relative_gap = 1e-2;
  // Below this bound the problem counts as solved exactly (normalised units; 1e-9 is below the
  // programs' own accuracy).
  double zero_gamma = 1e-9;
  // Linear programs at most, undecided ones included.
  int max_programs = 40;
  // Lower bounds exclude structures up to this many times their smallest depth; see
  // CertifiesInfeasible.
  double max_extent = 1e6;
  LpOptions lp;

  std::optional<std::string> Problem() const;

  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("relative_gap", relative_gap);
    visit("zero_gamma", zero_gamma);
    visit("max_programs", max_programs);
    visit("max_extent", max_extent);
  }
};

enum class BisectionStatus {
  kConverged,       // the bracket is as narrow as asked
  kIterationLimit,  // max_programs solved, or both sides undecided; the bracket is still right
  kSolverFailed,    // no program gave a structure with positive depths
};

struct BisectionResult {
  BisectionStatus status = BisectionStatus::kSolverFailed;
  MinimaxStructure structure;  // attains gamma_high; empty when gamma_high is infinite
  // The least possible largest residual lies in [gamma_low, gamma_high], normalised units.
  // gamma_low is proven (CertifiesInfeasible), gamma_high attained.
  double gamma_low = 0.0;
  double gamma_high = kInfinity;
  int num_programs = 0;
  int num_undecided = 0;
};

/// Finds the structure whose largest residual per image axis is smallest, by bisection over linear
/// programs.
/// @param start  a first structure, when there is one: its MaxBoxResidual is the first upper bound.
/// Cost:    one sparse LP of 5 columns per observation per halving; gap 1e-2 takes 7 to 12.
/// Source:  Kahl & Hartley, Multiple-View Geometry under the L-infinity Norm, PAMI 2008; ours
/// bounds
///          |dx| and |dy| apart, jumps to the recomputed residual of each feasible answer, and
///          accepts a lower bound only with a checked certificate.
BisectionResult MinimiseMaxResidual(const MinimaxProblem& problem,
                                    const BisectionOptions& options,
                                    const MinimaxStructure* start = nullptr);

}  // namespace rotslam
