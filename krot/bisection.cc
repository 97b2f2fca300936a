#include "krot/bisection.h"

#include <cmath>
#include <stdexcept>

namespace rotslam {
namespace {

// Where to try next inside (low, high): the middle, in ratio once both ends are known, and off the
// middle after an undecided answer, each time by another fraction.
double NextGamma(const BisectionResult& bracket, int undecided_in_a_row) {
  static constexpr double kFractions[] = {0.5, 0.35, 0.65, 0.2, 0.8, 0.1, 0.9};
  const double fraction = kFractions[undecided_in_a_row % 7];
  if (bracket.gamma_low <= 0.0) return fraction * bracket.gamma_high;
  return bracket.gamma_low * std::pow(bracket.gamma_high / bracket.gamma_low, fraction);
}

bool Narrow(const BisectionResult& bracket, const BisectionOptions& options) {
  return bracket.gamma_high <= options.zero_gamma ||
         bracket.gamma_high - bracket.gamma_low <= options.relative_gap * bracket.gamma_high;
}

void Offer(const MinimaxProblem& problem, MinimaxStructure structure, BisectionResult& bracket) {
  if (structure.point_in_world.empty()) return;
  const double residual = MaxBoxResidual(problem, structure);
  if (residual >= bracket.gamma_high) return;
  bracket.gamma_high = residual;
  bracket.structure = std::move(structure);
}

}  // namespace

std::optional<std::string> BisectionOptions::Problem() const {
  if (!(relative_gap > 0.0)) {
    return "relative_gap is " + std::to_string(relative_gap) + ", must be above 0";
  }
  if (!(zero_gamma > 0.0)) {
    return "zero_gamma is " + std::to_string(zero_gamma) + ", must be above 0";
  }
  if (max_programs < 1) {
    return "max_programs is " + std::to_string(max_programs) + ", must be at least 1";
  }
  if (!(max_extent > 1.0)) {
    return "max_extent is " + std::to_string(max_extent) + ", must be above 1";
  }
  return std::nullopt;
}

BisectionResult MinimiseMaxResidual(const MinimaxProblem& problem,
                                    const BisectionOptions& options,
                                    const MinimaxStructure* start) {
  if (const auto trouble = options.Problem()) {
    throw std::invalid_argument("BisectionOptions: " + *trouble);
  }
  BisectionResult bracket;
  if (start != nullptr) Offer(problem, *start, bracket);
  // Without a start: widen gamma until a program gives a structure with positive depths.
  for (double gamma = 0.01; bracket.gamma_high == kInfinity && gamma < 100.0; gamma *= 10.0) {
    const MinimaxLpResult lp = SolveFeasibility(problem, gamma, options.lp);
    ++bracket.num_programs;
    Offer(problem, lp.structure, bracket);
  }
  if (bracket.gamma_high == kInfinity) return bracket;

  constexpr int kMaxUndecidedInARow = 7;
  int undecided_in_a_row = 0;
  bracket.status = BisectionStatus::kIterationLimit;
  while (!Narrow(bracket, options)) {
    if (bracket.num_programs >= options.max_programs) return bracket;
    if (undecided_in_a_row >= kMaxUndecidedInARow) return bracket;
    const double gamma = NextGamma(bracket, undecided_in_a_row);
    const MinimaxLpResult lp = SolveFeasibility(problem, gamma, options.lp);
    ++bracket.num_programs;
    const double high_before = bracket.gamma_high;
    Offer(problem, lp.structure, bracket);
    if (bracket.gamma_high <= gamma) {
      undecided_in_a_row = 0;
      continue;
    }
    if (CertifiesInfeasible(problem, gamma, lp.multipliers, options.max_extent)) {
      bracket.gamma_low = gamma;
      undecided_in_a_row = 0;
      continue;
    }
    ++bracket.num_undecided;
    // A better structure moves the bracket too, though it does not decide this gamma.
    undecided_in_a_row = bracket.gamma_high < 0.9 * high_before ? 0 : undecided_in_a_row + 1;
  }
  bracket.status = BisectionStatus::kConverged;
  return bracket;
}

}  // namespace rotslam
