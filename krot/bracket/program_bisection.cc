#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "krot/bracket/bracket_search.h"
#include "krot/structure/minimax_lp.h"

namespace rotslam {
namespace {

// The slack the infeasible programs needed, nearly linear in gamma close to the optimum.
struct Miss {
  double gamma;
  double slack;
};

// Where the slack of the last two misses runs out, when that lies inside the bracket.
std::optional<double> PredictOptimum(const Bracket& bracket, const std::vector<Miss>& misses) {
  if (misses.size() < 2) return std::nullopt;
  const Miss& a = misses[misses.size() - 2];
  const Miss& b = misses.back();
  if (!(a.slack > b.slack) || !(b.gamma > a.gamma)) return std::nullopt;
  const double optimum = b.gamma + b.slack * (b.gamma - a.gamma) / (a.slack - b.slack);
  if (!(optimum > bracket.gamma_low) || !(optimum < bracket.gamma_high)) return std::nullopt;
  return optimum;
}

// Where to try next inside (low, high): just above the predicted optimum, then just below it; the
// middle without a prediction, in ratio once both ends are known, and off the middle after an
// undecided answer, each time by another fraction.
double NextGamma(const Bracket& bracket,
                 const std::vector<Miss>& misses,
                 int undecided_in_a_row,
                 double relative_gap) {
  static constexpr double kFractions[] = {0.5, 0.35, 0.65, 0.2, 0.8, 0.1, 0.9};
  if (undecided_in_a_row == 0) {
    if (const auto optimum = PredictOptimum(bracket, misses)) {
      const double above = *optimum * (1.0 + 0.4 * relative_gap);
      const double below = *optimum * (1.0 - 0.4 * relative_gap);
      if (above < bracket.gamma_high) return above;
      if (below > bracket.gamma_low) return below;
    }
  }
  const double fraction = kFractions[undecided_in_a_row % 7];
  if (bracket.gamma_low <= 0.0) return fraction * bracket.gamma_high;
  return bracket.gamma_low * std::pow(bracket.gamma_high / bracket.gamma_low, fraction);
}

}  // namespace

// Below this bound the problem counts as solved exactly (normalised units; below the programs' own
// accuracy).
static constexpr double kZeroGamma = 1e-9;

bool Continue(const BisectionOptions& options, const Bracket& bracket, int num_points) {
  if (!options.on_progress) return true;
  return options.on_progress(
      {bracket.gamma_low, bracket.gamma_high, bracket.num_programs, num_points});
}

bool Narrow(const Bracket& bracket, const BisectionOptions& options, const SearchLimits& limits) {
  if (bracket.gamma_high == kInfinity) return false;
  return bracket.gamma_high <= kZeroGamma || bracket.gamma_high <= limits.gamma_of_others ||
         bracket.gamma_high - bracket.gamma_low <= options.relative_gap * bracket.gamma_high;
}

void Offer(const MinimaxProblem& problem, MinimaxStructure structure, Bracket& bracket) {
  if (structure.point_in_world.empty()) return;
  const double residual = MaxBoxResidual(problem, structure);
  if (residual >= bracket.gamma_high) return;
  bracket.gamma_high = residual;
  bracket.structure = std::move(structure);
}

Bracket BisectPrograms(const MinimaxProblem& problem,
                       const BisectionOptions& options,
                       const SearchLimits& limits,
                       const MinimaxStructure* start) {
  Bracket bracket;
  bracket.num_points_in_programs = problem.num_points;
  if (start != nullptr) Offer(problem, *start, bracket);
  // Without a start: widen gamma until a program gives a structure with positive depths.
  for (double gamma = 0.01; bracket.gamma_high == kInfinity && gamma < 1000.0; gamma *= 10.0) {
    const MinimaxLpResult lp = SolveFeasibility(problem, gamma, options.lp);
    ++bracket.num_programs;
    Offer(problem, lp.structure, bracket);
  }
  if (bracket.gamma_high == kInfinity) return bracket;
  if (limits.only_feasible) {
    bracket.status = BisectionStatus::kCancelled;
    return bracket;
  }

  constexpr int kMaxUndecidedInARow = 7;
  int undecided_in_a_row = 0;
  std::vector<Miss> misses;
  bracket.status = BisectionStatus::kIterationLimit;
  while (!Narrow(bracket, options, limits)) {
    if (bracket.num_programs >= limits.max_programs) return bracket;
    if (undecided_in_a_row >= kMaxUndecidedInARow) return bracket;
    const double gamma = NextGamma(bracket, misses, undecided_in_a_row, options.relative_gap);
    const MinimaxLpResult lp = SolveFeasibility(problem, gamma, options.lp);
    ++bracket.num_programs;
    const double high_before = bracket.gamma_high;
    Offer(problem, lp.structure, bracket);
    if (!Continue(options, bracket, problem.num_points)) {
      bracket.status = BisectionStatus::kCancelled;
      return bracket;
    }
    if (bracket.gamma_high <= gamma) {
      undecided_in_a_row = 0;
      continue;
    }
    if (CertifiesInfeasible(problem, gamma, lp.multipliers, kMaxExtent)) {
      bracket.gamma_low = gamma;
      misses.push_back({gamma, lp.objective});
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
