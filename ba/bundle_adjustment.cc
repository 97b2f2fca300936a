#include "ba/bundle_adjustment.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "ba/bundle_state.h"
#include "ba/classification.h"
#include "ba/minimisation.h"
#include "rotodom/types/triangulation.h"

namespace rotslam {
namespace {

double SecondsSince(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

bool AllFinite(const BundleState& state) {
  return std::all_of(state.centers.begin(), state.centers.end(), [](const Eigen::Vector3d& center) {
    return center.allFinite();
  });
}

// Classifies, minimises, and tells whether the next round may go on from here.
bool RunRound(const Camera& camera,
              const std::string& name,
              const BundleRound& round,
              const BundleOptions& options,
              BundleState& state,
              BundleResult& result) {
  const auto start = std::chrono::steady_clock::now();
  ClassifyAll(camera, round.max_error_px, /*retriangulate=*/true, options, state);
  const ResidualStatistics before = Statistics(camera, state);
  const auto solver_start = std::chrono::steady_clock::now();
  const std::optional<MinimisationResult> minimised = Minimise(camera, round, options, state);
  if (!minimised) {
    result.status = BundleStatus::kTooLittleData;
    result.message = "round " + name + " had no moving frame with at least " +
                     std::to_string(options.min_frame_observations) +
                     " observations of points that fit and have depth";
    return false;
  }
  if (result.summary.rounds.empty()) result.summary.before = before;

  const ceres::Solver::Summary& solved = minimised->solver;
  BundleRoundSummary summary = minimised->counts;
  summary.name = name;
  summary.initial_cost = solved.initial_cost;
  summary.final_cost = solved.final_cost;
  summary.iterations = static_cast<int>(solved.iterations.size()) - 1;
  summary.termination = solved.message;
  summary.solver_seconds = SecondsSince(solver_start);
  summary.seconds = SecondsSince(start);
  result.summary.rounds.push_back(summary);
  if (!solved.IsSolutionUsable() || !AllFinite(state)) {
    result.status = BundleStatus::kSolverFailed;
    result.message = "round " + name + ": " + solved.message;
    return false;
  }
  result.status = solved.termination_type == ceres::CONVERGENCE ? BundleStatus::kConverged
                                                                : BundleStatus::kIterationLimit;
  return true;
}

// Poses and well-fitting tracks of `state`.
void TakeResult(const BundleProblem& problem, const BundleState& state, BundleResult& result) {
  Reconstruction& out = result.reconstruction;
  out.cam_from_world = problem.start.cam_from_world;
  std::vector<bool> center_seen(state.centers.size(), false);
  for (const TrackState& entry : state.tracks) {
    if (entry.kind != TrackKind::kPoint) continue;
    Track track = *entry.track;
    track.observations.clear();
    for (const Sight& sight : entry.sights) {
      if (!sight.used) continue;
      track.observations.push_back(*sight.observation);
      center_seen[state.frames[sight.frame].center] = true;
    }
    result.summary.num_observations += static_cast<int>(track.observations.size());
    out.point_in_world[track.id] = entry.position;
    out.tracks.push_back(std::move(track));
  }
  for (const FrameState& frame : state.frames) {
    out.cam_from_world[frame.id] = frame.cam_from_world;
    if (center_seen[frame.center] || frame.fixed) {
      out.center_in_world[frame.id] = state.centers[frame.center];
    }
    if (frame.weak) result.weak_frames.push_back(frame.id);
  }
  int num_given = 0;
  for (const Track& track : problem.start.tracks) {
    num_given += static_cast<int>(track.observations.size());
  }
  BundleSummary& summary = result.summary;
  summary.num_frames = static_cast<int>(out.center_in_world.size());
  summary.num_points = static_cast<int>(out.tracks.size());
  summary.num_dropped_tracks = static_cast<int>(problem.start.tracks.size()) - summary.num_points;
  summary.num_dropped_observations = num_given - summary.num_observations;
}

}  // namespace

const char* Name(BundleStatus status) {
  switch (status) {
    case BundleStatus::kNotRun:
      return "not run";
    case BundleStatus::kConverged:
      return "converged";
    case BundleStatus::kIterationLimit:
      return "iteration limit";
    case BundleStatus::kTooLittleData:
      return "too little data";
    case BundleStatus::kSolverFailed:
      return "solver failed";
  }
  return "unknown";
}

BundleResult RefineBundle(const BundleProblem& problem, const BundleOptions& options) {
  const auto start = std::chrono::steady_clock::now();
  BundleState state = MakeBundleState(problem, options);
  BundleResult result;
  double max_error_px = 0.0;
  bool good = true;
  const auto run = [&](const std::string& name, const BundleRound& round) {
    if (!good || !round.enabled) return;
    max_error_px = round.max_error_px;
    good = RunRound(problem.camera, name, round, options, state, result);
  };
  run("bridge", options.bridge);
  run("coarse", options.coarse);
  run("fine", options.fine);

  BundleSummary& summary = result.summary;
  for (const BundleRoundSummary& round : summary.rounds) summary.iterations += round.iterations;
  if (!summary.rounds.empty()) {
    summary.initial_cost = summary.rounds.front().initial_cost;
    summary.final_cost = summary.rounds.back().final_cost;
  }
  if (good) {
    ClassifyAll(problem.camera, max_error_px, /*retriangulate=*/false, options, state);
    summary.after = Statistics(problem.camera, state);
    TakeResult(problem, state, result);
    result.message = summary.rounds.back().termination;
  } else {
    result.reconstruction = problem.start;
  }
  summary.seconds = SecondsSince(start);
  return result;
}

Reconstruction TriangulateTracks(const BundleProblem& problem, const BundleOptions& options) {
  BundleState state = MakeBundleState(problem, options);
  ClassifyAll(problem.camera, options.fine.max_error_px, /*retriangulate=*/true, options, state);
  BundleResult result;
  TakeResult(problem, state, result);
  result.reconstruction.center_in_world = problem.start.center_in_world;
  return std::move(result.reconstruction);
}

Reconstruction WithoutShallowPoints(const Reconstruction& reconstruction, double min_angle_deg) {
  Reconstruction result = reconstruction;
  result.tracks.clear();
  result.point_in_world.clear();
  for (const Track& track : reconstruction.tracks) {
    const auto point = reconstruction.point_in_world.find(track.id);
    if (point == reconstruction.point_in_world.end()) continue;
    std::vector<Sighting> sightings;
    for (const Observation& observation : track.observations) {
      const auto cam_from_world = reconstruction.cam_from_world.find(observation.frame);
      const auto center = reconstruction.center_in_world.find(observation.frame);
      if (cam_from_world == reconstruction.cam_from_world.end() ||
          center == reconstruction.center_in_world.end()) {
        continue;
      }
      sightings.push_back({cam_from_world->second, center->second, observation.bearing});
    }
    if (TriangulationAngle(sightings, point->second) < min_angle_deg * kRadFromDeg) continue;
    result.point_in_world.insert(*point);
    result.tracks.push_back(track);
  }
  return result;
}

}  // namespace rotslam
