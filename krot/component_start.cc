#include "krot/component_start.h"

#include <algorithm>
#include <cstddef>
#include <set>
#include <utility>

#include "krot/growth.h"
#include "krot/linear_start.h"
#include "krot/named_problem.h"
#include "krot/selection.h"

namespace rotslam {
namespace {

// The observations of `problem` with residual at most `limit`, without points then seen once. Every
// view stays, so the gauge does.
MinimaxProblem Survivors(const MinimaxProblem& problem,
                         const std::vector<double>& residuals,
                         double limit) {
  std::vector<int> count(problem.num_points, 0);
  for (std::size_t o = 0; o < problem.observations.size(); ++o) {
    if (residuals[o] <= limit) ++count[problem.observations[o].point];
  }
  MinimaxProblem survivors;
  survivors.R_c_w = problem.R_c_w;
  std::vector<int> new_point(problem.num_points, -1);
  for (int i = 0; i < problem.num_points; ++i) {
    if (count[i] >= 2) new_point[i] = survivors.num_points++;
  }
  for (std::size_t o = 0; o < problem.observations.size(); ++o) {
    ImageObservation observation = problem.observations[o];
    if (residuals[o] > limit || new_point[observation.point] < 0) continue;
    observation.point = new_point[observation.point];
    survivors.observations.push_back(observation);
  }
  return survivors;
}

std::optional<ComponentStart> SolvePrograms(const RotationMap& cam_from_world,
                                            const std::vector<Track>& tracks,
                                            const KrotOptions& options,
                                            const KrotUnits& units) {
  SelectionOptions selection;
  selection.observations_per_view = options.observations_per_view;
  selection.min_parallax_rad = units.lp_parallax_rad;
  std::vector<Track> selected;
  for (const int t : SelectTracks(cam_from_world, tracks, selection)) selected.push_back(tracks[t]);
  const NamedProblem named = MakeProblem(cam_from_world, selected);
  if (named.problem.num_views() < 2) return std::nullopt;
  RobustStart robust = SolveRobustStart(named.problem, units.gamma, options.robust_start);
  if (robust.call != LpCallStatus::kCompleted) return std::nullopt;
  const MinimaxProblem survivors = Survivors(named.problem, robust.residuals, 1.001 * units.gamma);
  if (survivors.observations.empty()) return std::nullopt;
  std::optional<MinimaxStructure> structure = std::move(robust.structure);
  if (options.start == "linear") structure = SolveLinearStart(survivors);
  if (!structure) return std::nullopt;
  ComponentStart start;
  start.num_programs = robust.num_programs;
  for (int view = 0; view < named.problem.num_views(); ++view) {
    start.centers[named.views[view]] = structure->center_in_world[view];
  }
  return start;
}

}  // namespace

std::optional<ComponentStart> StartComponent(const RotationMap& cam_from_world,
                                             const std::vector<Track>& tracks,
                                             const ViewComponent& component,
                                             const KrotOptions& options,
                                             const KrotUnits& units) {
  const std::size_t num_lp_views =
      std::min(component.views.size(), static_cast<std::size_t>(options.max_lp_views));
  const std::set<FrameId> lp_views(
      component.views.begin(), component.views.begin() + static_cast<std::ptrdiff_t>(num_lp_views));
  const auto lp_tracks = RestrictTracks(tracks, [&](const Observation& observation) {
    return lp_views.contains(observation.frame) && observation.bearing.z() >= units.min_z;
  });
  std::optional<ComponentStart> start = SolvePrograms(cam_from_world, lp_tracks, options, units);
  if (!start || start->centers.size() == component.views.size()) return start;
  GrowthOptions growth;
  growth.resection.threshold_rad = units.loose_rad;
  growth.resection.seed = options.seed;
  growth.min_angle_rad = units.lp_parallax_rad;
  growth.threshold_rad = units.loose_rad;
  const std::set<FrameId> members(component.views.begin(), component.views.end());
  const auto member_tracks = RestrictTracks(
      tracks, [&](const Observation& observation) { return members.contains(observation.frame); });
  const std::size_t before = start->centers.size();
  PlaceViews(cam_from_world, member_tracks, component.views, growth, start->centers);
  start->num_grown_views = static_cast<int>(start->centers.size() - before);
  return start;
}

}  // namespace rotslam
