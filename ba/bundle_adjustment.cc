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

// The rounds of one problem, one after the other.
class Rounds {
 public:
  Rounds(const Camera& calibrated,
         const BundleOptions& options,
         BundleState& state,
         BundleResult& result)
      : calibrated_(calibrated), options_(options), state_(state), result_(result) {}

  // Classifies and minimises, as long as nothing has gone wrong.
  void Run(const std::string& name, const BundleRound& round) {
    if (!good_ || !round.enabled) return;
    const auto start = std::chrono::steady_clock::now();
    max_error_px_ = round.max_error_px;
    ClassifyAll(round.max_error_px, /*retriangulate=*/true, options_, state_);
    const ResidualStatistics before = Statistics(state_);
    const bool is_first = result_.summary.rounds.empty();
    Minimise(name, round, start);
    if (good_ && is_first) result_.summary.before = before;
  }

  // Lets the lens move on the observations of the round before; keeps that when it gains enough.
  void TryLens(const BundleRound& round) {
    const LensOptions& lens = options_.lens;
    if (!good_ || !round.enabled) return;
    if (!lens.refine_focal && !lens.refine_distortion) return;
    const BundleState before = state_;
    refine_lens_ = true;
    Minimise("lens", round, std::chrono::steady_clock::now());
    if (!good_) return;
    const BundleRoundSummary& summary = result_.summary.rounds.back();
    result_.summary.lens_gain = 1.0 - summary.final_cost / summary.initial_cost;
    refine_lens_ = result_.summary.lens_gain >= lens.min_gain;
    result_.summary.lens_refined = refine_lens_;
    if (!refine_lens_) state_ = before;
  }

  bool good() const { return good_; }
  double max_error_px() const { return max_error_px_; }  // of the last round

 private:
  void Minimise(const std::string& name,
                const BundleRound& round,
                std::chrono::steady_clock::time_point start) {
    const auto solver_start = std::chrono::steady_clock::now();
    const std::optional<MinimisationResult> minimised =
        rotslam::Minimise(calibrated_, round, refine_lens_, options_, state_);
    good_ = minimised.has_value();
    if (!minimised) {
      result_.status = BundleStatus::kTooLittleData;
      result_.message = "round " + name + " had no moving frame with at least " +
                        std::to_string(options_.min_frame_observations) +
                        " observations of points that fit and have depth";
      return;
    }
    const ceres::Solver::Summary& solved = minimised->solver;
    BundleRoundSummary summary = minimised->counts;
    summary.name = name;
    summary.initial_cost = solved.initial_cost;
    summary.final_cost = solved.final_cost;
    summary.iterations = static_cast<int>(solved.iterations.size()) - 1;
    summary.termination = solved.message;
    summary.solver_seconds = SecondsSince(solver_start);
    summary.seconds = SecondsSince(start);
    result_.summary.rounds.push_back(summary);
    good_ = solved.IsSolutionUsable() && AllFinite(state_);
    if (!good_) {
      result_.status = BundleStatus::kSolverFailed;
      result_.message = "round " + name + ": " + solved.message;
      return;
    }
    result_.status = solved.termination_type == ceres::CONVERGENCE ? BundleStatus::kConverged
                                                                   : BundleStatus::kIterationLimit;
  }

  const Camera& calibrated_;
  const BundleOptions& options_;
  BundleState& state_;
  BundleResult& result_;
  bool good_ = true;
  bool refine_lens_ = false;
  double max_error_px_ = 0.0;
};

// Poses and well-fitting tracks of `state`.
void TakeResult(const BundleProblem& problem, const BundleState& state, BundleResult& result) {
  result.camera = state.camera;
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
      track.observations.back().bearing = sight.bearing;
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
  Rounds rounds(problem.camera, options, state, result);
  rounds.Run("bridge", options.bridge);
  rounds.Run("coarse", options.coarse);
  rounds.TryLens(options.coarse);
  rounds.Run("fine", options.fine);

  BundleSummary& summary = result.summary;
  for (const BundleRoundSummary& round : summary.rounds) summary.iterations += round.iterations;
  if (!summary.rounds.empty()) {
    summary.initial_cost = summary.rounds.front().initial_cost;
    summary.final_cost = summary.rounds.back().final_cost;
  }
  if (rounds.good()) {
    ClassifyAll(rounds.max_error_px(), /*retriangulate=*/false, options, state);
    summary.after = Statistics(state);
    TakeResult(problem, state, result);
    result.message = summary.rounds.back().termination;
  } else {
    result.camera = problem.camera;
    result.reconstruction = problem.start;
  }
  summary.seconds = SecondsSince(start);
  return result;
}

Reconstruction TriangulateTracks(const BundleProblem& problem, const BundleOptions& options) {
  BundleState state = MakeBundleState(problem, options);
  ClassifyAll(options.fine.max_error_px, /*retriangulate=*/true, options, state);
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
