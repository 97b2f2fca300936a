#pragma once

#include <functional>
#include <optional>
#include <string>

#include "krot/lp/linear_program.h"

namespace rotslam {

/// Progress of a search.
struct BisectionProgress {
  double gamma_low = 0.0;
  double gamma_high = kInfinity;
  int num_programs = 0;
  int num_points = 0;  // in the program just solved
};

/// The programs that narrow the bracket.
enum class BisectionMethod {
  // Our own interior-point programs over the few points that hold the optimum, the LP engine where
  // they stall.
  kInterior,
  // The LP engine alone, over all points: ten to a hundred times the time and memory, and no code
  // in common but the proofs.
  kPrograms,
};

/// How closely the bisection brackets the optimum, and by which programs.
struct BisectionOptions {
  BisectionMethod method = BisectionMethod::kInterior;
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

}  // namespace rotslam
