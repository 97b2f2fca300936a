#include "krot/bracket/working_set.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <span>
#include <utility>

#include "krot/structure/structure_system.h"

namespace rotslam {
namespace {

// Sets of views that grow together.
class ViewSets {
 public:
  explicit ViewSets(int num_views) : parent_(num_views) {
    std::iota(parent_.begin(), parent_.end(), 0);
  }
  int Find(int view) {
    while (parent_[view] != view) view = parent_[view] = parent_[parent_[view]];
    return view;
  }
  // False when they were joined before.
  bool Join(int a, int b) {
    a = Find(a);
    b = Find(b);
    if (a == b) return false;
    parent_[std::max(a, b)] = std::min(a, b);
    return true;
  }

 private:
  std::vector<int> parent_;
};

// Observations of point `i`, as positions.
std::span<const int> Of(const PointGroups& groups, int i) {
  return {groups.observations.data() + groups.begin[i],
          static_cast<std::size_t>(groups.begin[i + 1] - groups.begin[i])};
}

// Cells of every view's image, over the part its own observations cover.
class Cells {
 public:
  explicit Cells(const MinimaxProblem& problem)
      : low_(problem.num_views(), Eigen::Vector2d::Constant(kFar)),
        high_(problem.num_views(), Eigen::Vector2d::Constant(-kFar)),
        taken_(static_cast<std::size_t>(problem.num_views()) * kColumns * kRows, false) {
    for (const ImageObservation& observation : problem.observations) {
      low_[observation.view] = low_[observation.view].cwiseMin(observation.xy);
      high_[observation.view] = high_[observation.view].cwiseMax(observation.xy);
    }
  }
  std::size_t Index(const ImageObservation& observation) const {
    const int v = observation.view;
    const Eigen::Vector2d range = (high_[v] - low_[v]).cwiseMax(1e-12);
    const Eigen::Vector2d at = (observation.xy - low_[v]).cwiseQuotient(range);
    const int column = std::min(kColumns - 1, static_cast<int>(at.x() * kColumns));
    const int row = std::min(kRows - 1, static_cast<int>(at.y() * kRows));
    return (static_cast<std::size_t>(v) * kRows + row) * kColumns + column;
  }
  bool Taken(const ImageObservation& observation) const { return taken_[Index(observation)]; }
  void Take(const ImageObservation& observation) { taken_[Index(observation)] = true; }

 private:
  static constexpr double kFar = 1e300;
  static constexpr int kColumns = 4;
  static constexpr int kRows = 3;
  std::vector<Eigen::Vector2d> low_;
  std::vector<Eigen::Vector2d> high_;
  std::vector<bool> taken_;
};

}  // namespace

std::vector<SubProblem> ConnectedParts(const MinimaxProblem& problem) {
  const PointGroups groups(problem);
  ViewSets sets(problem.num_views());
  const auto constrains = [&](int i) { return groups.begin[i + 1] - groups.begin[i] >= 2; };
  for (int i = 0; i < problem.num_points; ++i) {
    const auto observations = Of(groups, i);
    for (const int o : observations) {
      sets.Join(problem.observations[observations.front()].view, problem.observations[o].view);
    }
  }
  std::vector<int> part_of(problem.num_views(), -1);
  std::vector<int> view_in_part(problem.num_views(), -1);
  std::vector<SubProblem> parts;
  const auto add_view = [&](int view) {
    int& part = part_of[sets.Find(view)];
    if (part < 0) {
      part = static_cast<int>(parts.size());
      parts.emplace_back();
    }
    if (view_in_part[view] < 0) {
      view_in_part[view] = parts[part].problem.num_views();
      parts[part].problem.R_c_w.push_back(problem.R_c_w[view]);
      parts[part].views.push_back(view);
    }
    return part;
  };
  std::vector<bool> used(problem.num_views(), false);
  for (int i = 0; i < problem.num_points; ++i) {
    if (!constrains(i)) continue;
    for (const int o : Of(groups, i)) used[problem.observations[o].view] = true;
  }
  for (int view = 0; view < problem.num_views(); ++view) {
    if (used[view]) add_view(view);
  }
  for (int i = 0; i < problem.num_points; ++i) {
    if (!constrains(i)) continue;
    SubProblem& part = parts[add_view(problem.observations[Of(groups, i).front()].view)];
    for (const int o : Of(groups, i)) {
      const ImageObservation& observation = problem.observations[o];
      part.problem.observations.push_back(
          {view_in_part[observation.view], part.problem.num_points, observation.xy});
    }
    ++part.problem.num_points;
    part.points.push_back(i);
  }
  std::stable_sort(parts.begin(), parts.end(), [](const SubProblem& a, const SubProblem& b) {
    return a.points.size() > b.points.size();
  });
  return parts;
}

SubProblem RestrictToPoints(const MinimaxProblem& problem, const std::vector<bool>& chosen) {
  SubProblem part;
  part.problem.R_c_w = problem.R_c_w;
  part.views.resize(problem.num_views());
  std::iota(part.views.begin(), part.views.end(), 0);
  std::vector<int> new_point(problem.num_points, -1);
  for (int i = 0; i < problem.num_points; ++i) {
    if (!chosen[i]) continue;
    new_point[i] = part.problem.num_points++;
    part.points.push_back(i);
  }
  for (ImageObservation observation : problem.observations) {
    observation.point = new_point[observation.point];
    if (observation.point >= 0) part.problem.observations.push_back(observation);
  }
  return part;
}

std::vector<bool> SpreadPoints(const MinimaxProblem& problem, int points_per_view) {
  const PointGroups groups(problem);
  std::vector<int> order(problem.num_points);
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) {
    return Of(groups, a).size() > Of(groups, b).size();
  });
  std::vector<bool> chosen(problem.num_points, false);
  std::vector<int> count(problem.num_views(), 0);
  Cells cells(problem);
  ViewSets sets(problem.num_views());
  const auto choose = [&](int i) {
    chosen[i] = true;
    for (const int o : Of(groups, i)) {
      const ImageObservation& observation = problem.observations[o];
      ++count[observation.view];
      cells.Take(observation);
      sets.Join(problem.observations[Of(groups, i).front()].view, observation.view);
    }
  };
  const auto wants = [&](int o) { return count[problem.observations[o].view] < points_per_view; };
  // First what fills empty cells, then what fills views, then what joins parts.
  for (const int i : order) {
    const auto observations = Of(groups, i);
    const auto fills = std::count_if(observations.begin(), observations.end(), [&](int o) {
      return wants(o) && !cells.Taken(problem.observations[o]);
    });
    if (2 * fills >= static_cast<std::ptrdiff_t>(observations.size()) && fills > 0) choose(i);
  }
  for (const int i : order) {
    const auto observations = Of(groups, i);
    if (!chosen[i] && std::any_of(observations.begin(), observations.end(), wants)) choose(i);
  }
  for (const int i : order) {
    const auto observations = Of(groups, i);
    if (chosen[i]) continue;
    const bool joins = std::any_of(observations.begin(), observations.end(), [&](int o) {
      return sets.Find(problem.observations[o].view) !=
             sets.Find(problem.observations[observations.front()].view);
    });
    if (joins) choose(i);
  }
  return chosen;
}

int AddWorstPoints(const MinimaxProblem& problem,
                   const std::vector<double>& residuals,
                   double limit,
                   int per_view,
                   std::vector<bool>& chosen) {
  std::vector<std::vector<int>> candidates(problem.num_views());
  for (const ImageObservation& observation : problem.observations) {
    const int i = observation.point;
    if (chosen[i] || !(residuals[i] > limit)) continue;
    std::vector<int>& of_view = candidates[observation.view];
    if (of_view.empty() || of_view.back() != i) of_view.push_back(i);
  }
  int added = 0;
  for (std::vector<int>& of_view : candidates) {
    std::stable_sort(
        of_view.begin(), of_view.end(), [&](int a, int b) { return residuals[a] > residuals[b]; });
    for (int k = 0; k < std::min(per_view, static_cast<int>(of_view.size())); ++k) {
      added += !chosen[of_view[k]];
      chosen[of_view[k]] = true;
    }
  }
  return added;
}

}  // namespace rotslam
