#pragma once

#include <vector>

#include <Eigen/Core>

#include "krot/structure/minimax_problem.h"
#include "krot/structure/structure_system.h"

namespace rotslam {

/// When a feasibility program counts as decided.
struct InteriorOptions {
  // Ends when the gap between the program's bounds is below this share of gamma, or a tenth of the
  // slack.
  double tolerance = 1e-3;
  // Depths stay above this share of the reference's: what keeps structures from collapsing. The
  // nearer to one, the more slack below the optimum and the shorter the way from the reference.
  double depth_floor = 0.5;
  // Ends as soon as the slack is negative, with a structure well inside all half-spaces.
  bool stop_when_feasible = false;
  int max_iterations = 60;
};

/// The result of an interior-point program. It is not verified: use MaxBoxResidual for the
/// structure and CertifiesInfeasible for the multipliers.
struct InteriorResult {
  bool converged = false;
  MinimaxStructure structure;       // the last iterate
  std::vector<double> multipliers;  // 5 per observation as in MinimaxLpResult
  double slack = 0.0;               // of the last iterate
  double slack_bound = 0.0;         // lower bound of the slack when dual feasible
  int iterations = 0;
};

/// Interior-point method for the linear program
///   min s  s.t.  a_k . (X - c) <= s depth_o (k < 4),  d >= depth_floor depth_o,  mean(d / depth_o)
///   = 1
/// over all observations o, with the half-space normals a_k at `gamma` and depth_o the depths d of
/// a reference structure. The unit of the slack is that of the residual, so gamma + s predicts the
/// optimum. The program at gamma = residual of the reference is a step of Dinkelbach's method in
/// the form that converges superlinearly; s > 0 proves gamma infeasible by the multipliers. The
/// bounds on the mean from both sides keep the central path bounded, which points at infinity would
/// otherwise prevent.
/// Source:  Mehrotra, On the implementation of a primal-dual interior point method, SIAM J. Opt.
///          1992; Crouzeix, Ferland & Schaible, A note on an algorithm for generalized fractional
///          programs, JOTA 1986.
class MinimaxInterior {
 public:
  /// Keeps a reference to `problem`.
  explicit MinimaxInterior(const MinimaxProblem& problem);

  /// @param reference  also the first iterate. Where it has depths that are not positive, depth
  ///                   bounds have slack as well until they are.
  InteriorResult Solve(double gamma,
                       const MinimaxStructure& reference,
                       const InteriorOptions& options);

  /// The same without a reference: all depth_o are one. Ends as soon as all depths are positive and
  /// all residuals are within 2 gamma.
  InteriorResult FindFeasible(double gamma, const InteriorOptions& options);

 private:
  const MinimaxProblem& problem_;
  StructureSystem system_;
};

}  // namespace rotslam
