#include "krot/component_start.h"

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <set>
#include <utility>

#include "krot/initialisation/global_positioning.h"
#include "krot/initialisation/register_views.h"
#include "krot/initialisation/robust_start.h"
#include "krot/initialisation/robust_triangulation.h"
#include "krot/initialisation/selection.h"
#include "krot/named_problem.h"
#include "krot/structure/blocks.h"

namespace rotslam {
namespace {

// Positions of the tracks' views from a spread of the tracks.
std::optional<ComponentStart> SolveSelected(const RotationMap& cam_from_world,
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
  ComponentStart start;
  std::optional<MinimaxStructure> structure;
  if (options.start == KrotStart::kPositioning) {
    structure = SolveGlobalPositioning(named.problem, units.loose_rad);
  } else {
    RobustStart robust = SolveRobustStart(named.problem, units.gamma);
    start.num_programs = robust.num_programs;
    if (robust.call == LpCallStatus::kCompleted) structure = std::move(robust.structure);
  }
  if (!structure) return std::nullopt;
  for (int view = 0; view < named.problem.num_views(); ++view) {
    start.centers[named.views[view]] = structure->center_in_world[view];
  }
  return start;
}

// The tracks that at least two of the views see in front of them, as they see them.
std::vector<Track> TracksOf(const std::set<FrameId>& views,
                            const std::vector<Track>& tracks,
                            double min_z) {
  const auto is_in_front = [&](const Observation& observation) {
    return views.contains(observation.frame) && observation.bearing.z() >= min_z;
  };
  return RestrictTracks(tracks, is_in_front, 2);
}

// The views, in the order of time, cut into pieces that overlap by a quarter.
std::vector<std::set<FrameId>> Overlapping(const ViewComponent& component, std::size_t size) {
  std::vector<FrameId> views = component.views;
  std::sort(views.begin(), views.end());
  const std::size_t step = size - size / 4;
  std::vector<std::set<FrameId>> pieces;
  for (std::size_t first = 0;; first += step) {
    // The last piece is as long as the others.
    const std::size_t begin = std::min(first, views.size() - std::min(size, views.size()));
    const auto from = views.begin() + static_cast<std::ptrdiff_t>(begin);
    pieces.emplace_back(from, from + static_cast<std::ptrdiff_t>(std::min(size, views.size())));
    if (begin + size >= views.size()) return pieces;
  }
}

// What the programs' positions bear out: views that are tied by tracks that fit, each part a block.
// A few chance matches can have tied more.
std::vector<Block> FittingBlocks(const RotationMap& cam_from_world,
                                 const std::vector<Track>& tracks,
                                 const CenterMap& centers,
                                 const ComponentOptions& options,
                                 const KrotUnits& units) {
  std::vector<Track> fitting;
  std::vector<Eigen::Vector3d> points;
  for (const Track& track : tracks) {
    std::vector<int> observations;
    const auto point = TriangulateRobustly(
        PosedRays(cam_from_world, centers, track, /*focal_px=*/1.0, &observations),
        units.lp_parallax_rad,
        units.loose_rad);
    if (!point) continue;
    points.push_back(point->point_in_world);
    fitting.emplace_back().id = track.id;
    for (const int inlier : point->inliers) {
      fitting.back().observations.push_back(track.observations[observations[inlier]]);
    }
  }
  std::vector<Block> blocks;
  for (const ViewComponent& part : FindComponents(cam_from_world, fitting, options)) {
    Block& block = blocks.emplace_back();
    for (const FrameId view : part.views) block.centers[view] = centers.at(view);
    for (std::size_t t = 0; t < fitting.size(); ++t) {
      if (!block.centers.contains(fitting[t].observations.front().frame)) continue;
      block.points[fitting[t].id] = points[t];
    }
  }
  return blocks;
}

// Programs over pieces of a component, whose time grows with its length only, joined by what the
// pieces share.
std::optional<ComponentStart> SolveInBlocks(const KrotProblem& problem,
                                            const ViewComponent& component,
                                            const ComponentOptions& component_options) {
  const auto& [cam_from_world, tracks, options, units] = problem;
  ComponentStart start;
  std::vector<Block> blocks;
  for (const std::set<FrameId>& piece :
       Overlapping(component, static_cast<std::size_t>(options.max_lp_views))) {
    const auto piece_tracks = TracksOf(piece, tracks, units.min_z);
    for (const ViewComponent& part :
         FindComponents(cam_from_world, piece_tracks, component_options)) {
      const std::set<FrameId> views(part.views.begin(), part.views.end());
      const auto part_tracks = TracksOf(views, piece_tracks, units.min_z);
      const auto solved = SolveSelected(cam_from_world, part_tracks, options, units);
      if (!solved) continue;
      start.num_programs += solved->num_programs;
      std::ranges::move(
          FittingBlocks(cam_from_world, part_tracks, solved->centers, component_options, units),
          std::back_inserter(blocks));
    }
  }
  start.centers = BlendBlocks(blocks, JoinBlocks(blocks));
  if (start.centers.size() < 2) return std::nullopt;
  return start;
}

}  // namespace

std::optional<ComponentStart> StartComponent(const KrotProblem& problem,
                                             const ViewComponent& component,
                                             const ComponentOptions& component_options) {
  const auto& [cam_from_world, tracks, options, units] = problem;
  const std::set<FrameId> members(component.views.begin(), component.views.end());
  // Programs alone take more than their length by being long.
  const bool by_blocks = options.start != KrotStart::kPositioning &&
                         component.views.size() > static_cast<std::size_t>(options.max_lp_views);
  std::optional<ComponentStart> start =
      by_blocks
          ? SolveInBlocks(problem, component, component_options)
          : SolveSelected(cam_from_world, TracksOf(members, tracks, units.min_z), options, units);
  if (!start || start->centers.size() == component.views.size()) return start;
  RegistrationOptions growth;
  growth.resection.threshold_rad = units.loose_rad;
  growth.resection.seed = options.seed;
  growth.min_angle_rad = units.lp_parallax_rad;
  growth.threshold_rad = units.loose_rad;
  const auto member_tracks = RestrictTracks(tracks, members, 2);
  const std::size_t before = start->centers.size();
  RegisterViews(cam_from_world, member_tracks, component.views, growth, start->centers);
  start->num_grown_views = static_cast<int>(start->centers.size() - before);
  return start;
}

}  // namespace rotslam
