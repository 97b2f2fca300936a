#include "ba/solver/minimisation.h"

#include <algorithm>

#include <ceres/iteration_callback.h>
#include <ceres/types.h>

#include "ba/problem/adjustment_problem.h"

namespace rotslam {
namespace {

// Keeps Levenberg-Marquardt's damping above rounding, for what the data leave open: the length of
// directions, scale and place of parts that share no track.
constexpr double kMaxTrustRegionRadius = 1e10;

// Ends a minimisation when what is still to come is less than a share of the cost, if each step
// goes on to gain a part of what the one before gained. Ceres itself works a whole step out to see
// that it was not worth it.
class Arrival final : public ceres::IterationCallback {
 public:
  explicit Arrival(double tolerance) : tolerance_(tolerance) {}

  ceres::CallbackReturnType operator()(const ceres::IterationSummary& step) override {
    if (step.iteration == 0 || !step.step_is_successful) return ceres::SOLVER_CONTINUE;
    const double ratio = gain_ > 0.0 ? step.cost_change / gain_ : 1.0;
    // Of the last two: the first steps gain quadratically, the later ones do not.
    const double slower = std::max(ratio, ratio_);
    gain_ = step.cost_change;
    ratio_ = ratio < 1.0 ? ratio : 0.0;
    const bool ends = slower < 1.0 && gain_ * slower / (1.0 - slower) < tolerance_ * step.cost;
    return ends ? ceres::SOLVER_TERMINATE_SUCCESSFULLY : ceres::SOLVER_CONTINUE;
  }

 private:
  double tolerance_;
  double gain_ = 0.0;   // of the last step
  double ratio_ = 0.0;  // of its gain to that of the one before
};

ceres::Solver::Options SolverOptions(const BundleRound& round,
                                     const BundleOptions& options,
                                     AdjustmentProblem& problem) {
  ceres::Solver::Options solver;
  solver.linear_solver_type = problem.Counts().num_frames <= options.max_dense_frames
                                  ? ceres::DENSE_SCHUR
                                  : ceres::SPARSE_SCHUR;
  solver.sparse_linear_algebra_library_type = ceres::SUITE_SPARSE;
  solver.linear_solver_ordering = problem.ordering();
  solver.num_threads = 1;
  solver.max_num_iterations = round.max_iterations;
  solver.function_tolerance = round.function_tolerance;
  solver.gradient_tolerance = 0.0;
  solver.parameter_tolerance = 1e-12;
  solver.initial_trust_region_radius = round.initial_radius;
  solver.max_trust_region_radius = kMaxTrustRegionRadius;
  solver.logging_type = ceres::SILENT;
  solver.callbacks.push_back(&problem.followers());
  return solver;
}

}  // namespace

std::optional<MinimisationResult> Minimise(const Camera& calibrated,
                                           const BundleRound& round,
                                           bool refine_lens,
                                           const BundleOptions& options,
                                           BundleState& state) {
  AdjustmentProblem problem(calibrated, round, refine_lens, options, state);
  if (problem.Empty()) return std::nullopt;
  MinimisationResult result;
  result.counts = problem.Counts();
  ceres::Solver::Options solver = SolverOptions(round, options, problem);
  Arrival arrival(round.function_tolerance);
  solver.callbacks.push_back(&arrival);
  ceres::Solve(solver, &problem.problem(), &result.solver);
  problem.TakeNumbers(options.lens, options.num_threads);
  return result;
}

}  // namespace rotslam
