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

/// What an interior-point program gave. Claims only: MaxBoxResidual of the structure and
/// CertifiesInfeasible of the multipliers are the proofs.
struct InteriorResult {
  bool converged = false;
  MinimaxStructure structure;       // the last iterate
  std::vector<double> multipliers;  // 5 per observation as in MinimaxLpResult
  double slack = 0.0;               // of the last iterate
  double slack_bound = 0.0;         // below the least slack when dual feasible
  int iterations = 0;
};

/// Interior-point method for the linear program
///   min s  s.t.  a_k . (X - c) <= s depth_o (k < 4),  d >= depth_floor depth_o,  mean(d / depth_o)
///   = 1
/// over all observations o, with the half-space normals a_k at `gamma` and depth_o the depths d of
/// a reference structure. Slack counts in units of the residual, so gamma + s predicts the optimum
/// and the program at gamma = residual of the reference is a step of Dinkelbach's method in the
/// form that converges superlinearly; s > 0 proves gamma infeasible through the multipliers. The
/// mean, held from both sides, keeps the central path bounded where points at infinity would drag
/// a program without it away.
/// Source:  Mehrotra, On the implementation of a primal-dual interior point method, SIAM J. Opt.
///          1992; Crouzeix, Ferland & Schaible, A note on an algorithm for generalized fractional
///          programs, JOTA 1986.
class MinimaxInterior {
 public:
  /// Keeps a reference to `problem`.
  explicit MinimaxInterior(const MinimaxProblem& problem);

  /// @param reference  the first iterate as well. Where it has depths that are not positive, depth
  ///                   bounds get slack too until they are.
  InteriorResult Solve(double gamma,
                       const MinimaxStructure& reference,
                       const InteriorOptions& options);

  /// The same without a reference, as if all depths were one. Ends as soon as they are positive and
  /// the residuals within 2 gamma.
  InteriorResult FindFeasible(double gamma, const InteriorOptions& options);

 private:
  const MinimaxProblem& problem_;
  StructureSystem system_;
};

}  // namespace rotslam
