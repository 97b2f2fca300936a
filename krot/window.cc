#include "krot/window.h"

#include <algorithm>
#include <chrono>
#include <set>
#include <stdexcept>
#include <utility>

#include "krot/initialisation/robust_start.h"
#include "krot/initialisation/selection.h"
#include "krot/named_problem.h"
#include "krot/structure/components.h"
#include "krot/track_points.h"
#include "rotodom/types/stopwatch.h"

namespace rotslam {
namespace {

// The smallest known depth counts so many times the smallest depth asked for: new points may lie
// nearer.
constexpr double kNearer = 10.0;

// The part of what is known that a window hangs on.
struct KnownPart {
  int component = -1;
  CenterMap centers;
  PointMap points;
};

KnownPart TakeKnown(const KrotSolution& known, const std::vector<Track>& tracks) {
  KnownPart part;
  std::set<FrameId> views;
  for (const Track& track : tracks) {
    for (const Observation& observation : track.observations) views.insert(observation.frame);
  }
  for (auto view = views.rbegin(); view != views.rend() && part.component < 0; ++view) {
    const auto found = known.component.find(*view);
    if (found != known.component.end()) part.component = found->second;
  }
  for (const FrameId view : views) {
    const auto found = known.component.find(view);
    if (found == known.component.end() || found->second != part.component) continue;
    part.centers[view] = known.center_in_world.at(view);
  }
  for (const Track& track : tracks) {
    const auto point = known.point_in_world.find(track.id);
    if (point == known.point_in_world.end()) continue;
    const bool is_ours = std::any_of(
        track.observations.begin(), track.observations.end(), [&](const Observation& observation) {
          return part.centers.contains(observation.frame);
        });
    if (is_ours) part.points.insert(*point);
  }
  return part;
}

// The window's tracks as far as the programs can use them: views in front and of no other
// component.
std::vector<Track> UsableTracks(const std::vector<Track>& tracks,
                                const KrotSolution& known,
                                const KnownPart& part,
                                double min_z) {
  std::vector<Track> usable;
  for (const Track& track : tracks) {
    Track copy = track;
    std::erase_if(copy.observations, [&](const Observation& observation) {
      const bool elsewhere = known.center_in_world.contains(observation.frame) &&
                             !part.centers.contains(observation.frame);
      return elsewhere || observation.bearing.z() < min_z;
    });
    if (copy.observations.size() >= 2) usable.push_back(std::move(copy));
  }
  return usable;
}

// What is known at its place, new centres at the newest known one and new points at the median
// depth from there; `scale` times as large.
struct WindowProblem {
  NamedProblem named;
  MinimaxStructure start;
  double scale = 1.0;
};

std::vector<double> KnownDepths(const RotationMap& cam_from_world,
                                const std::vector<Track>& tracks,
                                const KnownPart& part) {
  std::vector<double> depths;
  for (const Track& track : tracks) {
    const auto point = part.points.find(track.id);
    if (point == part.points.end()) continue;
    for (const Observation& observation : track.observations) {
      const auto center = part.centers.find(observation.frame);
      if (center == part.centers.end()) continue;
      const double depth =
          (cam_from_world.at(observation.frame) * (point->second - center->second)).z();
      if (depth > 0.0) depths.push_back(depth);
    }
  }
  std::sort(depths.begin(), depths.end());
  return depths;
}

WindowProblem MakeWindow(const RotationMap& cam_from_world,
                         const std::vector<Track>& tracks,
                         const KnownPart& part,
                         const std::vector<double>& depths) {
  WindowProblem window;
  window.named = MakeProblem(cam_from_world, tracks);
  MinimaxProblem& problem = window.named.problem;
  window.scale = kNearer / depths.front();
  const double typical = depths[depths.size() / 2];
  const Eigen::Vector3d newest = part.centers.rbegin()->second;
  for (const FrameId view : window.named.views) {
    const auto center = part.centers.find(view);
    const bool is_known = center != part.centers.end();
    problem.view_fixed.push_back(is_known);
    window.start.center_in_world.push_back(window.scale * (is_known ? center->second : newest));
  }
  for (const Track& track : tracks) {
    const auto point = part.points.find(track.id);
    const bool is_known = point != part.points.end();
    problem.point_fixed.push_back(is_known);
    const Observation& last = track.observations.back();
    const Eigen::Vector3d guess =
        newest + typical * (cam_from_world.at(last.frame).Inverse() * last.bearing);
    window.start.point_in_world.push_back(window.scale * (is_known ? point->second : guess));
  }
  return window;
}

// Centres of the new views that the programs place.
CenterMap PlaceNewViews(const KrotProblem& problem, const KnownPart& part, KrotSolution& solution) {
  const auto& [cam_from_world, tracks, options, units] = problem;
  SelectionOptions selection;
  selection.observations_per_view = options.observations_per_view;
  selection.min_parallax_rad = units.lp_parallax_rad;
  std::vector<Track> selected;
  for (const int t : SelectTracks(cam_from_world, tracks, selection)) {
    const bool has_new = std::any_of(
        tracks[t].observations.begin(), tracks[t].observations.end(), [&](const auto& observation) {
          return !part.centers.contains(observation.frame);
        });
    if (has_new) selected.push_back(tracks[t]);
  }
  const std::vector<double> depths = KnownDepths(cam_from_world, selected, part);
  if (depths.empty()) return {};
  const WindowProblem window = MakeWindow(cam_from_world, selected, part, depths);
  // The gauge is that of the known: the first view must be one.
  if (!part.centers.contains(window.named.views.front())) return {};
  const RobustStart robust = SolveRobustStart(window.named.problem, units.gamma, &window.start);
  solution.num_programs += robust.num_programs;
  if (robust.call != LpCallStatus::kCompleted) return {};
  const Eigen::Vector3d origin = part.centers.at(window.named.views.front());
  std::vector<int> num_fitting(window.named.views.size(), 0);
  for (std::size_t o = 0; o < robust.residuals.size(); ++o) {
    num_fitting[window.named.problem.observations[o].view] +=
        robust.residuals[o] <= units.loose_rad;
  }
  CenterMap centers;
  for (std::size_t view = 0; view < window.named.views.size(); ++view) {
    if (window.named.problem.view_fixed[view]) continue;
    if (num_fitting[view] < kMinSharedPoints) continue;
    centers[window.named.views[view]] =
        origin + robust.structure.center_in_world[view] / window.scale;
  }
  return centers;
}

// New points, and how far they and the known ones are from what the new views see.
void TakeNewPoints(const KrotProblem& problem,
                   const CenterMap& centers,
                   const KnownPart& part,
                   KrotSolution& solution) {
  const auto& [cam_from_world, tracks, options, units] = problem;
  const std::vector<double> thresholds(tracks.size(), units.gamma);
  const TriangulatedTracks points = TriangulateAll(problem, centers, thresholds);
  double largest = 0.0;
  for (std::size_t t = 0; t < tracks.size(); ++t) {
    const auto known = part.points.find(tracks[t].id);
    if (known == part.points.end() && !points[t]) continue;
    const Eigen::Vector3d& point_in_world =
        known == part.points.end() ? points[t]->point_in_world : known->second;
    for (const Observation& observation : tracks[t].observations) {
      const auto center = centers.find(observation.frame);
      if (center == centers.end() || part.centers.contains(observation.frame)) continue;
      const Eigen::Vector3d point_in_cam =
          cam_from_world.at(observation.frame) * (point_in_world - center->second);
      const double residual = point_in_cam.z() > 0.0
                                  ? (point_in_cam.hnormalized() - observation.bearing.hnormalized())
                                        .cwiseAbs()
                                        .maxCoeff()
                                  : kInfinity;
      if (residual > units.loose_rad) {
        solution.removed.push_back({tracks[t].id, observation.frame, RemovalReason::kReprojection});
      } else {
        largest = std::max(largest, residual);
      }
    }
    solution.point_in_world.insert({tracks[t].id, point_in_world});
  }
  solution.gamma_low = 0.0;
  solution.gamma_high = largest;
}

}  // namespace

KrotSolution ExtendKnownRotation(const KrotSolution& known,
                                 const RotationMap& cam_from_world,
                                 const std::vector<Track>& input,
                                 const Camera& camera,
                                 const KrotOptions& options) {
  const auto begin = std::chrono::steady_clock::now();
  RequireContract(cam_from_world, input, camera, options);
  const KrotUnits units(options, camera);
  KrotSolution solution = known;
  solution.removed.clear();
  solution.active.clear();
  solution.num_programs = solution.num_grown_views = 0;
  solution.num_bracket_observations = solution.num_bracket_tracks = 0;
  std::vector<RemovedObservation> removed;
  const std::vector<Track> clean = CleanTracks(input, removed);
  const KnownPart part = TakeKnown(known, clean);
  const std::vector<Track> tracks = UsableTracks(clean, known, part, units.min_z);
  const KrotProblem problem = {cam_from_world, tracks, options, units};
  const CenterMap placed = PlaceNewViews(problem, part, solution);
  solution.status = KrotStatus::kInfeasible;
  solution.message = "no new view shares enough tracks with known ones";
  if (!placed.empty()) {
    CenterMap centers = part.centers;
    for (const auto& [view, center] : placed) {
      centers[view] = solution.center_in_world[view] = center;
      solution.component[view] = part.component;
    }
    solution.removed = std::move(removed);
    TakeNewPoints(problem, centers, part, solution);
    solution.status = KrotStatus::kIterationLimit;
    solution.message = std::to_string(placed.size()) + " views placed on known ones";
  }
  solution.seconds = SecondsSince(begin);
  return solution;
}

}  // namespace rotslam
