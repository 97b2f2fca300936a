#include "krot/bracket/bisection.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "krot/bracket/bracket_search.h"
#include "krot/bracket/working_set.h"
#include "rotodom/types/stopwatch.h"

namespace rotslam {
namespace {

double Depth(const MinimaxProblem& problem,
             const MinimaxStructure& structure,
             const ImageObservation& observation) {
  return problem.R_c_w[observation.view].row(2).dot(structure.point_in_world[observation.point] -
                                                    structure.center_in_world[observation.view]);
}

MinimaxStructure Restrict(const MinimaxStructure& structure, const SubProblem& part) {
  MinimaxStructure restricted;
  restricted.center_in_world.reserve(part.views.size());
  restricted.point_in_world.reserve(part.points.size());
  for (const int view : part.views) {
    restricted.center_in_world.push_back(structure.center_in_world[view]);
  }
  for (const int point : part.points) {
    restricted.point_in_world.push_back(structure.point_in_world[point]);
  }
  return restricted;
}

// First centre at the origin, smallest depth one.
void Enter(const SubProblem& part, const MinimaxStructure& found, MinimaxStructure& structure) {
  double least = kInfinity;
  for (const ImageObservation& observation : part.problem.observations) {
    least = std::min(least, Depth(part.problem, found, observation));
  }
  const double scale = 1.0 / least;
  const Eigen::Vector3d origin = found.center_in_world.front();
  for (std::size_t k = 0; k < part.views.size(); ++k) {
    structure.center_in_world[part.views[k]] = scale * (found.center_in_world[k] - origin);
  }
  for (std::size_t k = 0; k < part.points.size(); ++k) {
    structure.point_in_world[part.points[k]] = scale * (found.point_in_world[k] - origin);
  }
}

// Points seen once lie on their ray, at depth one.
void PlaceFreePoints(const MinimaxProblem& problem, MinimaxStructure& structure) {
  std::vector<int> count(problem.num_points, 0);
  for (const ImageObservation& observation : problem.observations) ++count[observation.point];
  for (const ImageObservation& observation : problem.observations) {
    if (count[observation.point] != 1) continue;
    structure.point_in_world[observation.point] =
        structure.center_in_world[observation.view] +
        problem.R_c_w[observation.view].transpose() *
            Eigen::Vector3d(observation.xy.x(), observation.xy.y(), 1.0);
  }
}

BisectionStatus Worse(BisectionStatus a, BisectionStatus b) {
  const auto rank = [](BisectionStatus status) {
    switch (status) {
      case BisectionStatus::kConverged:
        return 0;
      case BisectionStatus::kIterationLimit:
        return 1;
      case BisectionStatus::kCancelled:
        return 2;
      case BisectionStatus::kSolverFailed:
        return 3;
    }
    return 3;
  };
  return rank(a) < rank(b) ? b : a;
}

void RequireUsable(const MinimaxProblem& problem,
                   const BisectionOptions& options,
                   const MinimaxStructure* start) {
  if (const auto trouble = options.Problem()) {
    throw std::invalid_argument("BisectionOptions: " + *trouble);
  }
  CheckProblem(problem);
  if (start == nullptr) return;
  if (static_cast<int>(start->center_in_world.size()) != problem.num_views() ||
      static_cast<int>(start->point_in_world.size()) != problem.num_points) {
    throw std::invalid_argument("minimax problem: the start has other views or points");
  }
}

void Solve(const MinimaxProblem& problem,
           const BisectionOptions& options,
           const MinimaxStructure* start,
           BisectionResult& result) {
  result.status = BisectionStatus::kConverged;
  result.structure.center_in_world.assign(problem.num_views(), Eigen::Vector3d::Zero());
  result.structure.point_in_world.assign(problem.num_points, Eigen::Vector3d::Zero());
  for (const SubProblem& part : ConnectedParts(problem)) {
    SearchLimits limits;
    limits.gamma_of_others = result.gamma_low;
    limits.max_programs = options.max_programs - result.num_programs;
    limits.only_feasible = result.status == BisectionStatus::kCancelled;
    MinimaxStructure part_start;
    if (start != nullptr) part_start = Restrict(*start, part);
    const auto search =
        options.method == BisectionMethod::kInterior ? SearchBracket : BisectPrograms;
    const Bracket bracket =
        part.views.size() == 1
            ? SearchSingleView(part.problem, options)
            : search(part.problem, options, limits, start != nullptr ? &part_start : nullptr);
    result.num_programs += bracket.num_programs;
    result.num_undecided += bracket.num_undecided;
    result.num_points_in_programs += bracket.num_points_in_programs;
    result.gamma_low = std::max(result.gamma_low, bracket.gamma_low);
    result.status = Worse(result.status, bracket.status);
    if (bracket.gamma_high == kInfinity) {
      result.structure = {};
      return;
    }
    Enter(part, bracket.structure, result.structure);
  }
  PlaceFreePoints(problem, result.structure);
  result.gamma_high = MaxBoxResidual(problem, result.structure);
}

}  // namespace

BisectionResult MinimiseMaxResidual(const MinimaxProblem& problem,
                                    const BisectionOptions& options,
                                    const MinimaxStructure* start) {
  const auto begin = std::chrono::steady_clock::now();
  RequireUsable(problem, options, start);
  BisectionResult result;
  Solve(problem, options, start, result);
  const double active = (1.0 - options.relative_gap) * result.gamma_high;
  for (int o = 0; o < static_cast<int>(problem.observations.size()); ++o) {
    if (result.gamma_high == kInfinity) break;
    if (BoxResidual(problem, result.structure, problem.observations[o]) < active) continue;
    result.active.push_back(o);
  }
  result.seconds = SecondsSince(begin);
  return result;
}

}  // namespace rotslam
