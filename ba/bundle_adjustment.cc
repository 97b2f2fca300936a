#include "ba/bundle_adjustment.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <utility>

#include "ba/covariance/camera_covariances.h"
#include "ba/outliers/classification.h"
#include "ba/problem/bundle_state.h"
#include "ba/solver/minimisation.h"
#include "rotodom/camera/lens_parameters.h"
#include "rotodom/types/splitmix64.h"
#include "rotodom/types/stopwatch.h"
#include "rotodom/types/triangulation.h"

namespace rotslam {
namespace {

// Smallest spread of residuals, in sigmas, that anything is fitted to.
constexpr double kLeastSpread = 0.01;
// Steps of such a spread in an octave. Starts that end in the same place leave spreads that are one
// to three thousandths apart; with widths of their own they would end at costs as far apart.
constexpr double kSpreadSteps = 4.0;

bool AllFinite(const BundleState& state) {
  return std::all_of(state.centers.begin(), state.centers.end(), [](const Eigen::Vector3d& center) {
    return center.allFinite();
  });
}

// The state with tracks drawn at random until every frame that moves has `num_wanted` observations.
BundleState WithSomeTracks(const BundleState& state, int num_wanted) {
  std::vector<std::size_t> order(state.tracks.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(), [](std::size_t a, std::size_t b) {
    return HashOf(a) < HashOf(b);
  });
  std::vector<int> count(state.frames.size(), 0);
  std::vector<bool> taken(state.tracks.size(), false);
  for (const std::size_t t : order) {
    const std::vector<ObservationState>& observations = state.tracks[t].observations;
    taken[t] =
        std::any_of(observations.begin(), observations.end(), [&](const ObservationState& one) {
          return !state.frames[one.frame].fixed && count[one.frame] < num_wanted;
        });
    if (!taken[t]) continue;
    for (const ObservationState& one : observations) ++count[one.frame];
  }
  BundleState part;
  part.camera = state.camera;
  part.has_motion_blur = state.has_motion_blur;
  part.frames = state.frames;
  part.centers = state.centers;
  for (std::size_t t = 0; t < state.tracks.size(); ++t) {
    if (taken[t]) part.tracks.push_back(state.tracks[t]);
  }
  return part;
}

// Takes the cameras over from a part, and how its observations are weighed.
void TakeCameras(const BundleState& part, int num_threads, BundleState& state) {
  state.has_motion_blur = part.has_motion_blur;
  state.frames = part.frames;
  state.centers = part.centers;
  if (part.camera != state.camera) SetCamera(part.camera, num_threads, state);
}

std::vector<bool> UsedFlags(const BundleState& state) {
  std::vector<bool> flags;
  for (const TrackState& track : state.tracks) {
    for (const ObservationState& one : track.observations) flags.push_back(one.used);
  }
  return flags;
}

// The rounds of one problem, one after the other.
class Rounds {
 public:
  Rounds(const Camera& calibrated, const BundleOptions& options, BundleResult& result)
      : calibrated_(calibrated), options_(options), result_(result) {}

  // Classifies and minimises, as long as nothing has gone wrong.
  void Run(const std::string& name, const BundleRound& round, BundleState& state) {
    if (!good_ || !round.enabled) return;
    const auto start = std::chrono::steady_clock::now();
    last_ = round;
    ClassifyAll(round, Placement::kAnywhere, options_, state);
    const bool is_first = result_.summary.rounds.empty();
    const ResidualStatistics before = is_first ? Statistics(state) : ResidualStatistics{};
    Minimise(name, round, start, state);
    if (good_ && is_first) result_.summary.before = before;
  }

  // The fine round with its loss and its limit as wide as the residuals are (`loss_spreads`).
  BundleRound FineFor(const BundleState& state) const {
    const double octaves = std::log2(ResidualSpread(state));
    const double spread =
        std::max(kLeastSpread, std::exp2(std::round(kSpreadSteps * octaves) / kSpreadSteps));
    const auto narrow = [&](double spreads, double width) {
      return spreads > 0.0 ? std::min(width, spreads * spread) : width;
    };
    BundleRound round = options_.fine;
    round.loss_scale = narrow(options_.loss_spreads, round.loss_scale);
    const double limit = round.max_residual > 0.0 ? round.max_residual : round.max_error_px;
    round.max_residual = narrow(options_.limit_spreads, limit);
    return round;
  }

  // Once more with a narrower loss and limit, if the residuals of the round before ask for them.
  // @return  the fine round for what it leaves.
  BundleRound Narrow(BundleState& state) {
    BundleRound round = FineFor(state);
    if (round.loss_scale < last_.loss_scale || round.max_residual < last_.max_residual) {
      Run("narrow", round, state);
      round = FineFor(state);
    }
    return round;
  }

  // Classifies and minimises until classification changes next to nothing.
  // @param placement  where points are looked for the first time; from then on near where they are.
  void RunFinal(BundleRound round, Placement placement, BundleState& state) {
    // Few observations have changed: a step or two.
    constexpr double kEasier = 10.0;
    // Classification has settled when it changes less than this share of the observations.
    constexpr double kMaxChangedShare = 5e-4;
    if (!good_ || !round.enabled) return;
    last_ = round;
    if (options_.max_final_rounds == 0) ClassifyAll(round, placement, options_, state);
    for (int k = 0; k < options_.max_final_rounds && good_; ++k) {
      const auto start = std::chrono::steady_clock::now();
      const std::vector<bool> before = UsedFlags(state);
      ClassifyAll(round, k == 0 ? placement : Placement::kNearby, options_, state);
      const std::vector<bool> after = UsedFlags(state);
      std::size_t changed = 0;
      for (std::size_t o = 0; o < after.size(); ++o) changed += before[o] != after[o] ? 1 : 0;
      const auto total = static_cast<double>(std::count(after.begin(), after.end(), true));
      if (k > 0 && static_cast<double>(changed) <= kMaxChangedShare * total) return;
      if (k == 2) round.function_tolerance *= kEasier;
      Minimise("final", round, start, state);
      // What classification still changes does not move the lens.
      moves_lens_ = false;
    }
  }

  // Lets the lens move on the observations of the round before; keeps that when it gains enough,
  // where that is not clear over the same round without.
  void TryLens(const BundleRound& coarse, BundleState& state) {
    // A lens and the way that fits it change together over long distances, as in the fine round.
    BundleRound round = coarse;
    round.initial_radius = options_.fine.initial_radius;
    // Times the least gain: more than a round leaves to be gained that has come to its end.
    constexpr double kClear = 10.0;
    LensOptions& lens = options_.lens;
    if (!good_ || !round.enabled) return;
    if (!lens.RefinesAny()) return;
    const double tangential_share = lens.tangential_share;
    const bool tries_tangential = lens.min_tangential_gain > 0.0 && !IsTangential(state.camera);
    if (tries_tangential) lens.tangential_share = 0.0;
    const bool is_at_end = result_.status == BundleStatus::kConverged;
    BundleState without = state;
    const auto minimised = [&](bool refine_lens, BundleState& from) {
      refine_lens_ = refine_lens;
      Minimise("lens", round, std::chrono::steady_clock::now(), from);
      return result_.summary.rounds.back();
    };
    const BundleRoundSummary with = minimised(true, state);
    if (!good_) return;
    const auto gain_over = [&](double cost) {
      return with.final_cost < cost ? 1.0 - with.final_cost / cost : 0.0;
    };
    double gain = gain_over(with.initial_cost);
    const bool is_clear = is_at_end && gain >= kClear * lens.min_gain;
    if (gain >= lens.min_gain && !is_clear) {
      gain = gain_over(minimised(false, without).final_cost);
    }
    if (!good_) return;
    refine_lens_ = gain >= lens.min_gain;
    result_.summary.lens_gain = gain;
    result_.summary.lens_refined = refine_lens_;
    if (!refine_lens_) {
      state = std::move(without);
      return;
    }
    if (!tries_tangential || !HasTangential(state.camera.model)) return;
    BundleState centred = state;
    const double centred_cost = result_.summary.rounds.back().final_cost;
    lens.tangential_share = tangential_share;
    Minimise("lens", round, std::chrono::steady_clock::now(), state);
    if (!good_) return;
    result_.summary.tangential_gain =
        std::max(0.0, 1.0 - result_.summary.rounds.back().final_cost / centred_cost);
    if (result_.summary.tangential_gain >= lens.min_tangential_gain) return;
    lens.tangential_share = 0.0;
    state = std::move(centred);
  }

  // Of what the state holds now.
  void FindCovariances(const BundleRound& round, BundleState& state) {
    if (!options_.find_covariance && !(options_.find_lens_covariance && refine_lens_)) return;
    FindLensNoise(state);
    const auto found = rotslam::FindCovariances(calibrated_, round, refine_lens_, options_, state);
    if (!found) return;
    for (std::size_t k = 0; k < state.frames.size(); ++k) {
      if (found->poses[k]) result_.pose_covariance[state.frames[k].id] = *found->poses[k];
    }
    if (found->lens) {
      const LensCovariance covariance = state.lens_noise * state.lens_noise * *found->lens;
      result_.summary.lens_sigmas = SigmasOf(covariance.diagonal());
      result_.summary.lens_covariance = covariance;
    }
  }

  bool good() const { return good_; }
  const BundleRound& last() const { return last_; }

 private:
  void FindLensNoise(BundleState& state) const {
    if (!options_.lens.weighs_by_residuals) return;
    state.lens_noise = kCommonErrors * std::max(kLeastSpread, ResidualSpread(state));
  }

  // Zero for what was held.
  LensSigmas SigmasOf(const LensParameters& variances) const {
    const LensParameters priors = options_.lens.Sigmas(calibrated_.model);
    return SigmasInPixels((priors.array() > 0.0).select(variances.cwiseSqrt(), 0.0), calibrated_);
  }

  void Minimise(const std::string& name,
                const BundleRound& round,
                std::chrono::steady_clock::time_point start,
                BundleState& state) {
    if (refine_lens_ && moves_lens_) FindLensNoise(state);
    const std::optional<MinimisationResult> minimised =
        rotslam::Minimise(calibrated_, round, refine_lens_ && moves_lens_, options_, state);
    good_ = minimised.has_value();
    if (!minimised) {
      result_.status = BundleStatus::kTooLittleData;
      result_.message = "round " + name + " had no moving frame with at least " +
                        std::to_string(kMinFrameObservations) +
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
    summary.solver_seconds = solved.total_time_in_seconds;
    summary.seconds = SecondsSince(start);
    result_.summary.rounds.push_back(summary);
    good_ = solved.IsSolutionUsable() && AllFinite(state);
    if (!good_) {
      result_.status = BundleStatus::kSolverFailed;
      result_.message = "round " + name + ": " + solved.message;
      return;
    }
    result_.status = solved.termination_type == ceres::NO_CONVERGENCE
                         ? BundleStatus::kIterationLimit
                         : BundleStatus::kConverged;
  }

  const Camera& calibrated_;
  BundleOptions options_;  // of its lens what turns out
  BundleResult& result_;
  bool good_ = true;
  bool refine_lens_ = false;
  bool moves_lens_ = true;  // if it is refined at all
  BundleRound last_;
};

// Poses and well-fitting tracks of `state`.
Reconstruction MapOf(const BundleState& state) {
  Reconstruction map;
  for (const TrackState& entry : state.tracks) {
    if (entry.kind != TrackKind::kPoint) continue;
    Track track = *entry.track;
    track.observations.clear();
    for (const ObservationState& one : entry.observations) {
      if (!one.used) continue;
      track.observations.push_back(*one.observation);
      track.observations.back().bearing = one.bearing;
    }
    map.point_in_world[track.id] = entry.position;
    map.tracks.push_back(std::move(track));
  }
  for (const FrameState& frame : state.frames) {
    map.cam_from_world[frame.id] = frame.cam_from_world;
    map.center_in_world[frame.id] = state.centers[frame.center];
  }
  return map;
}

// Gives the points other observations; how many more than they had.
int Complete(const TrackCompletion& complete, int num_threads, BundleState& state) {
  const Reconstruction map = MapOf(state);
  std::vector<Track> tracks = complete(map, state.camera);
  const int num_more = NumObservations(tracks) - NumObservations(map.tracks);
  ReplaceTracks(std::move(tracks), num_threads, state);
  return num_more;
}

// Poses and well-fitting tracks of `state`.
void TakeResult(const BundleProblem& problem, const BundleState& state, BundleResult& result) {
  result.camera = state.camera;
  // Points tell both, directions the rotation.
  std::vector<bool> frame_turned(state.frames.size(), false);
  std::vector<bool> center_seen(state.centers.size(), false);
  for (const TrackState& entry : state.tracks) {
    if (entry.kind == TrackKind::kOut) continue;
    for (const ObservationState& one : entry.observations) {
      if (!one.used) continue;
      frame_turned[one.frame] = true;
      if (entry.kind == TrackKind::kPoint) center_seen[state.frames[one.frame].center] = true;
    }
  }
  Reconstruction& out = result.reconstruction;
  out = MapOf(state);
  result.summary.num_observations = NumObservations(out.tracks);
  for (std::size_t k = 0; k < state.frames.size(); ++k) {
    const FrameState& frame = state.frames[k];
    if (frame.weak) result.weak_frames.push_back(frame.id);
    if (frame.fixed) continue;
    if (!frame_turned[k]) out.cam_from_world.erase(frame.id);
    if (!frame_turned[k] || !center_seen[frame.center]) out.center_in_world.erase(frame.id);
  }
  const int num_given = NumObservations(problem.start.tracks);
  BundleSummary& summary = result.summary;
  summary.num_frames = static_cast<int>(out.center_in_world.size());
  summary.num_points = static_cast<int>(out.tracks.size());
  summary.num_dropped_tracks = static_cast<int>(problem.start.tracks.size()) - summary.num_points;
  summary.num_dropped_observations = num_given + summary.num_completed - summary.num_observations;
}

}  // namespace

BundleResult RefineBundle(const BundleProblem& problem,
                          const BundleOptions& options,
                          const TrackCompletion& complete) {
  const auto start = std::chrono::steady_clock::now();
  BundleState state = MakeBundleState(problem, options);
  BundleResult result;
  Rounds rounds(problem.camera, options, result);
  const bool in_part = options.preparing_observations > 0 && options.fine.enabled;
  std::optional<BundleState> part;
  if (in_part) part = WithSomeTracks(state, options.preparing_observations);
  BundleState& preparing = part ? *part : state;
  rounds.Run("fixed_rotation", options.fixed_rotation, preparing);
  rounds.Run("coarse", options.coarse, preparing);
  preparing.has_motion_blur = ShowsMotionBlur(preparing);
  rounds.TryLens(options.coarse, preparing);
  rounds.Run("fine", rounds.FineFor(preparing), preparing);
  // What support is asked of.
  std::optional<BundleState> given;
  if (complete && rounds.good()) {
    if (part) TakeCameras(*part, options.num_threads, state);
    ClassifyAll(options.fine, Placement::kAnywhere, options, state);
    given = state;
    result.summary.num_completed = Complete(complete, options.num_threads, state);
    if (part) part = WithSomeTracks(state, options.preparing_observations);
    rounds.Run("completed", options.coarse, preparing);
    rounds.Run("completed", rounds.FineFor(preparing), preparing);
  }
  const BundleRound final_round = rounds.Narrow(preparing);
  if (part) TakeCameras(*part, options.num_threads, state);
  rounds.RunFinal(final_round, part ? Placement::kAnywhere : Placement::kNearby, state);

  BundleSummary& summary = result.summary;
  for (const BundleRoundSummary& round : summary.rounds) summary.iterations += round.iterations;
  if (!summary.rounds.empty()) {
    const auto whole = std::find_if(
        summary.rounds.begin(), summary.rounds.end(), [&](const BundleRoundSummary& round) {
          return round.name == (in_part ? "final" : "fine");
        });
    const auto first = whole == summary.rounds.end() ? summary.rounds.begin() : whole;
    summary.initial_cost = first->initial_cost;
    summary.final_cost = summary.rounds.back().final_cost;
  }
  if (rounds.good()) {
    if (given) TakeCameras(state, options.num_threads, *given);
    summary.support = SupportWithin(options.fine, options, given ? *given : state);
    ClassifyAll(rounds.last(), Placement::kStays, options, state);
    summary.after = Statistics(state);
    summary.has_motion_blur = state.has_motion_blur;
    rounds.FindCovariances(options.fine, state);
    TakeResult(problem, state, result);
    result.message = summary.rounds.back().termination;
  } else {
    result.camera = problem.camera;
    result.reconstruction = problem.start;
  }
  summary.seconds = SecondsSince(start);
  return result;
}

Reconstruction TriangulateTracks(BundleProblem problem, const BundleOptions& options) {
  BundleState state = MakeBundleState(problem, options);
  for (TrackState& entry : state.tracks) {
    const auto known = problem.start.point_in_world.find(entry.track->id);
    entry.has_position = known != problem.start.point_in_world.end();
    if (entry.has_position) entry.position = known->second;
  }
  ClassifyAll(options.fine, Placement::kWhereKnown, options, state);
  Reconstruction map = std::move(problem.start);
  map.point_in_world.clear();
  // In place: of a long sequence the observations fill the memory.
  for (std::size_t k = 0; k < state.tracks.size(); ++k) {
    const TrackState& entry = state.tracks[k];
    Track& track = map.tracks[k];
    std::size_t count = 0;
    for (const ObservationState& one : entry.observations) {
      if (entry.kind != TrackKind::kPoint || !one.used) continue;
      Observation& kept = track.observations[count++];
      kept = Observation(*one.observation);
      kept.bearing = one.bearing;
    }
    track.observations.resize(count);
    if (count > 0)
      map.point_in_world.emplace_hint(map.point_in_world.end(), track.id, entry.position);
  }
  std::erase_if(map.tracks, [](const Track& track) { return track.observations.empty(); });
  return map;
}

Reconstruction WithoutShallowPoints(Reconstruction reconstruction, double min_angle_deg) {
  std::vector<PosedRay> rays;
  std::erase_if(reconstruction.tracks, [&](const Track& track) {
    const auto point = reconstruction.point_in_world.find(track.id);
    if (point == reconstruction.point_in_world.end()) return true;
    rays.clear();
    for (const Observation& observation : track.observations) {
      const auto cam_from_world = reconstruction.cam_from_world.find(observation.frame);
      const auto center = reconstruction.center_in_world.find(observation.frame);
      if (cam_from_world == reconstruction.cam_from_world.end() ||
          center == reconstruction.center_in_world.end()) {
        continue;
      }
      rays.push_back({cam_from_world->second, center->second, observation.bearing});
    }
    return TriangulationAngle(rays, point->second) < min_angle_deg * kRadFromDeg;
  });
  PointMap kept;
  for (const Track& track : reconstruction.tracks) {
    kept.insert(*reconstruction.point_in_world.find(track.id));
  }
  reconstruction.point_in_world = std::move(kept);
  return reconstruction;
}

}  // namespace rotslam
