#include "krot/initialisation/robust_start.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "krot/interior_point/l1_interior.h"

namespace rotslam {
namespace {

// Linear programs before the last one, at most. The first is plain L1, each later one lowers the
// price of what the one before called an outlier. With 10 % uniform outliers three rounds lose
// below 1 % of the inliers, one round 30 % (RobustStart tests); without outliers the first round
// ends it.
constexpr int kMaxRounds = 3;
// Price of missing the smallest depth by one, over that of missing a pixel bound by one at depth
// one. Large enough that structures do not collapse to buy off outliers.
constexpr double kDepthPrice = 10.0;

// Weight of one observation in the next round.
double NextWeight(const MinimaxProblem& problem,
                  const MinimaxStructure& structure,
                  const ImageObservation& observation,
                  double residual,
                  double gamma) {
  constexpr double kFloor = 1e-6;  // weight of an observation behind its camera
  if (residual == kInfinity) return kFloor;
  const double depth = problem.R_c_w[observation.view].row(2).dot(
      structure.point_in_world[observation.point] - structure.center_in_world[observation.view]);
  const double excess = std::max(0.0, residual - gamma) / gamma;
  return std::max(kFloor, 1.0 / ((1.0 + excess * excess) * std::max(1.0, depth)));
}

std::vector<double> NextWeights(const MinimaxProblem& problem,
                                const RobustStart& start,
                                double gamma) {
  std::vector<double> weights;
  for (std::size_t o = 0; o < problem.observations.size(); ++o) {
    weights.push_back(
        NextWeight(problem, start.structure, problem.observations[o], start.residuals[o], gamma));
  }
  return weights;
}

// @param given  values of fixed views and points.
// @param before  solution of the previous program.
MinimaxLpResult SolveProgram(const L1SlackProgram& program,
                             double tolerance,
                             const MinimaxStructure* given,
                             const MinimaxStructure* before) {
  // First product of slack and multiplier for a start from the previous solution; halves the
  // iterations (L1InteriorOptions).
  constexpr double kFirstProductNearby = 1e-3;
  L1InteriorOptions interior;
  interior.tolerance = tolerance;
  if (before != nullptr) interior.first_product = kFirstProductNearby;
  MinimaxLpResult result =
      SolveL1SlackInterior(program, interior, before != nullptr ? before : given);
  if (result.call == LpCallStatus::kCompleted || given != nullptr) return result;
  return SolveL1Slack(program);
}

// Solves one program. Where it fails, returns false and keeps the previous solution.
bool SolveRound(const MinimaxProblem& problem,
                double gamma,
                const std::vector<double>& weights,
                const MinimaxStructure* given,
                RobustStart& start) {
  // Solutions of the rounds only determine weights, so a coarse tolerance is enough.
  const double tolerance = gamma > 0.0 ? 1e-3 : 1e-6;
  const MinimaxStructure* const before =
      start.call == LpCallStatus::kCompleted ? &start.structure : nullptr;
  MinimaxLpResult lp =
      SolveProgram({problem, gamma, kDepthPrice, weights}, tolerance, given, before);
  ++start.num_programs;
  if (lp.call != LpCallStatus::kCompleted) return false;
  start.call = lp.call;
  start.structure = std::move(lp.structure);
  start.residuals.clear();
  for (const ImageObservation& observation : problem.observations) {
    start.residuals.push_back(BoxResidual(problem, start.structure, observation));
  }
  return true;
}

}  // namespace

RobustStart SolveRobustStart(const MinimaxProblem& problem,
                             double gamma,
                             const MinimaxStructure* given) {
  if (!(gamma > 0.0)) throw std::invalid_argument("robust start: gamma must be above 0");
  RobustStart start;
  std::vector<double> weights;
  for (bool done = false; !done && start.num_programs < kMaxRounds;) {
    if (!SolveRound(problem, gamma, weights, given, start)) return start;
    weights = NextWeights(problem, start, gamma);
    // Without outliers the weights have no effect.
    done = *std::max_element(start.residuals.begin(), start.residuals.end()) <= 1.01 * gamma;
  }
  // The bound zero, outliers still priced down: plain L1, which picks the likeliest structure from
  // inside the tube that the rounds leave open.
  SolveRound(problem, 0.0, weights, given, start);
  return start;
}

}  // namespace rotslam
