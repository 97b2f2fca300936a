#pragma once

#include <functional>
#include <optional>
#include <string>

#include "krot/lp/linear_program.h"

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
  // Below this bound the problem counts as solved exactly (normalised units; 1e-9 is below the
  // programs' own accuracy).
  double zero_gamma = 1e-9;
  // Linear programs at most, undecided ones included.
  int max_programs = 200;
  // Lower bounds exclude structures up to this many times their smallest depth; see
  // CertifiesInfeasible.
  double max_extent = 1e6;
  // The interior programs start from about this many points in each view ...
  int points_per_view = 8;
  // ... and each round adds, for each view, this many of those that miss the bound most. Adding
  // all that miss it makes the programs explode.
  int added_per_view = 4;
  LpOptions lp;
  // Called after every program; false stops the search, which then returns what it has. Not called
  // when empty.
  std::function<bool(const BisectionProgress&)> on_progress;

  std::optional<std::string> Problem() const;

  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("method", method);
    visit("relative_gap", relative_gap);
    visit("zero_gamma", zero_gamma);
    visit("max_programs", max_programs);
    visit("max_extent", max_extent);
    visit("points_per_view", points_per_view);
    visit("added_per_view", added_per_view);
  }
};

enum class BisectionStatus {
  kConverged,       // the bracket is as narrow as asked
  kIterationLimit,  // max_programs solved, or both sides undecided; the bracket is still right
  kSolverFailed,    // no program gave a structure with positive depths
  kCancelled,       // on_progress said so; the bracket is still right
};

}  // namespace rotslam
