#include "ba/bundle_adjustment.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <deque>
#include <limits>
#include <memory>
#include <stdexcept>

#include <ceres/loss_function.h>
#include <ceres/ordered_groups.h>
#include <ceres/problem.h>
#include <ceres/solver.h>

#include "ba/reprojection_cost.h"
#include "rotodom/types/parallel.h"
#include "rotodom/types/triangulation.h"

namespace rotslam {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
// Weight of the scale anchor: a share of 1e-4 of the scale costs as much as one sigma. The optimum
// does not depend on it.
constexpr double kScaleAnchorWeight = 1e4;
// Keeps Levenberg-Marquardt's damping above rounding, for what the data leave open: the length of
// directions, scale and place of parts that share no track.
constexpr double kMaxTrustRegionRadius = 1e10;
// Two-view hypotheses for a track in which not all observations agree.
constexpr int kMaxTrackHypotheses = 20;

double SecondsSince(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

struct FrameState {
  FrameId id;
  Rotation cam_from_world;
  int center = 0;      // index of its centre; frames that stand at one place share it
  bool fixed = false;  // pose held by the caller
  bool weak = false;   // too few observations to be in the last round
};

enum class TrackKind { kOut, kPoint, kDirection };

// An observation in a frame that has a pose.
struct Sight {
  const Observation* observation = nullptr;
  int frame = 0;
  bool used = false;
};

struct TrackState {
  const Track* track = nullptr;
  std::vector<Sight> sights;
  bool one_place = false;  // all sights from one centre: a direction, no depth
  TrackKind kind = TrackKind::kOut;
  bool has_position = false;
  Eigen::Vector3d position;  // point in the world, or direction when seen from one place
};

struct State {
  std::vector<FrameState> frames;
  std::vector<Eigen::Vector3d> centers;
  std::vector<TrackState> tracks;
};

[[noreturn]] void Refuse(const std::string& reason) {
  throw std::invalid_argument("RefineBundle: " + reason);
}

void CheckTrack(const Track& track) {
  const std::string name = "track " + std::to_string(track.id.value);
  std::set<FrameId> seen;
  for (const Observation& observation : track.observations) {
    const std::string where = name + ", frame " + std::to_string(observation.frame.value);
    if (!seen.insert(observation.frame).second) Refuse(where + " is observed twice");
    if (!observation.keypoint_px.allFinite() || !observation.bearing.allFinite()) {
      Refuse(where + ": the observation is not finite");
    }
    if (!(observation.sigma_px > 0.0) || !std::isfinite(observation.sigma_px)) {
      Refuse(where + ": sigma_px is " + std::to_string(observation.sigma_px) +
             ", must be positive");
    }
  }
}

void CheckContract(const BundleProblem& problem, const BundleOptions& options) {
  if (const auto text = options.Problem()) Refuse("option " + *text);
  if (const auto text = problem.camera.Problem()) Refuse("camera " + *text);
  const Reconstruction& start = problem.start;
  const auto has_pose = [&](FrameId frame) {
    return start.cam_from_world.contains(frame) && start.center_in_world.contains(frame);
  };
  for (const auto& [frame, center] : start.center_in_world) {
    if (!center.allFinite()) {
      Refuse("the centre of frame " + std::to_string(frame.value) + " is not finite");
    }
  }
  for (const auto& [track, point] : start.point_in_world) {
    if (!point.allFinite()) {
      Refuse("the point of track " + std::to_string(track.value) + " is not finite");
    }
  }
  for (const FrameId frame : problem.fixed_frames) {
    if (!has_pose(frame)) {
      Refuse("fixed frame " + std::to_string(frame.value) + " has no pose");
    }
  }
  for (const auto& [frame, other] : problem.shared_center) {
    if (!has_pose(frame) || !has_pose(other)) {
      Refuse("frame " + std::to_string((has_pose(frame) ? other : frame).value) +
             " shares a centre but has no pose");
    }
  }
  std::set<TrackId> seen;
  for (const Track& track : start.tracks) {
    if (!seen.insert(track.id).second) {
      Refuse("track " + std::to_string(track.id.value) + " is there twice");
    }
    CheckTrack(track);
  }
}

// The frame whose centre `frame` uses.
FrameId CenterOwner(const std::map<FrameId, FrameId>& shared_center, FrameId frame) {
  FrameId owner = frame;
  for (std::size_t step = 0; step <= shared_center.size(); ++step) {
    const auto next = shared_center.find(owner);
    if (next == shared_center.end() || next->second == owner) return owner;
    owner = next->second;
  }
  Refuse("shared_center of frame " + std::to_string(frame.value) + " runs in a circle");
}

State MakeState(const BundleProblem& problem) {
  State state;
  const Reconstruction& start = problem.start;
  std::map<FrameId, int> frame_index;
  std::map<FrameId, int> center_index;
  for (const auto& [id, cam_from_world] : start.cam_from_world) {
    if (!start.center_in_world.contains(id)) continue;
    const FrameId owner = CenterOwner(problem.shared_center, id);
    const auto [center, is_new] = center_index.try_emplace(owner, state.centers.size());
    if (is_new) state.centers.push_back(start.center_in_world.at(owner));
    frame_index[id] = static_cast<int>(state.frames.size());
    FrameState frame;
    frame.id = id;
    frame.cam_from_world = cam_from_world;
    frame.center = center->second;
    frame.fixed = problem.fixed_frames.contains(id);
    state.frames.push_back(frame);
  }
  for (const Track& track : start.tracks) {
    TrackState entry;
    entry.track = &track;
    std::set<int> places;
    for (const Observation& observation : track.observations) {
      const auto frame = frame_index.find(observation.frame);
      if (frame == frame_index.end()) continue;
      entry.sights.push_back({&observation, frame->second, false});
      places.insert(state.frames[frame->second].center);
    }
    entry.one_place = places.size() <= 1;
    const auto point = start.point_in_world.find(track.id);
    if (point != start.point_in_world.end() && !entry.one_place) {
      entry.has_position = true;
      entry.position = point->second;
    }
    state.tracks.push_back(std::move(entry));
  }
  return state;
}

// ---- Classification -----------------------------------------------------------------------------

Sighting AsSighting(const State& state, const Sight& sight, double focal_px) {
  const FrameState& frame = state.frames[sight.frame];
  return {frame.cam_from_world,
          state.centers[frame.center],
          sight.observation->bearing,
          sight.observation->sigma_px / focal_px};
}

// Reprojection error in pixels; infinite where the camera cannot see the position.
double ErrorPx(const Camera& camera,
               const State& state,
               const TrackState& track,
               const Sight& sight,
               const Eigen::Vector3d& position) {
  const FrameState& frame = state.frames[sight.frame];
  const Eigen::Vector3d in_cam =
      frame.cam_from_world *
      (track.one_place ? position : Eigen::Vector3d(position - state.centers[frame.center]));
  const std::optional<Eigen::Vector2d> pixel = camera.Project(in_cam);
  return pixel ? (*pixel - sight.observation->keypoint_px).norm() : kInfinity;
}

// Which observations a position explains, and how well it does over all of them.
struct Verdict {
  std::vector<bool> fits;
  int num_fits = 0;
  double score = kInfinity;  // sum of squared errors in sigmas, each cut off at the limit
};

class Classifier {
 public:
  // @param max_error_px  zero: whatever projects fits.
  Classifier(const Camera& camera,
             const State& state,
             double max_error_px,
             const BundleOptions& options)
      : camera_(camera),
        state_(state),
        max_error_px_(max_error_px),
        min_observations_(options.min_observations),
        min_angle_rad_(options.min_angle_deg * kRadFromDeg) {}

  // Marks the observations that the track's position, or else a new one, explains.
  void Classify(TrackState& track) const {
    std::optional<Eigen::Vector3d> best;
    Verdict best_verdict;
    const auto offer = [&](const std::optional<Eigen::Vector3d>& position) {
      if (!position || !position->allFinite()) return;
      Verdict verdict = Judge(track, *position);
      if (best && !(verdict.score < best_verdict.score)) return;
      best = position;
      best_verdict = std::move(verdict);
    };
    const int num_sights = static_cast<int>(track.sights.size());
    const auto all_fit = [&] { return best && best_verdict.num_fits == num_sights; };
    if (track.has_position) offer(track.position);
    if (!all_fit()) offer(Locate(track, std::vector<bool>(num_sights, true)));
    if (!all_fit() && (max_error_px_ > 0.0 || !best)) {
      for (const auto& [a, b] : Pairs(num_sights)) {
        std::vector<bool> chosen(num_sights, false);
        chosen[a] = chosen[b] = true;
        offer(Locate(track, chosen));
        if (all_fit()) break;
      }
      if (best && best_verdict.num_fits >= 2) offer(Locate(track, best_verdict.fits));
    }
    track.has_position = best.has_value();
    if (best) track.position = *best;
    Accept(track, best ? best_verdict.fits : std::vector<bool>(num_sights, false));
  }

  // The same with the position as it is.
  void Recheck(TrackState& track) const {
    if (track.kind == TrackKind::kOut) return;
    Accept(track, Judge(track, track.position).fits);
  }

  // Takes the observations marked in `fits` if together they make a point.
  void Accept(TrackState& track, const std::vector<bool>& fits) const {
    int count = 0;
    for (std::size_t k = 0; k < fits.size(); ++k) {
      Sight& sight = track.sights[k];
      sight.used = fits[k] && !state_.frames[sight.frame].weak;
      count += sight.used ? 1 : 0;
    }
    const bool enough = count >= min_observations_ && (track.one_place || IsDeep(track));
    track.kind = !enough           ? TrackKind::kOut
                 : track.one_place ? TrackKind::kDirection
                                   : TrackKind::kPoint;
    if (enough) return;
    for (Sight& sight : track.sights) sight.used = false;
  }

 private:
  double LimitPx(const Sight& sight) const {
    if (max_error_px_ == 0.0) return std::numeric_limits<double>::max();
    return max_error_px_ * std::max(1.0, sight.observation->sigma_px);
  }

  Verdict Judge(const TrackState& track, const Eigen::Vector3d& position) const {
    Verdict verdict;
    verdict.score = 0.0;
    for (const Sight& sight : track.sights) {
      const double error_px = ErrorPx(camera_, state_, track, sight, position);
      const double limit_px = LimitPx(sight);
      verdict.fits.push_back(error_px <= limit_px);
      verdict.num_fits += verdict.fits.back() ? 1 : 0;
      const double sigmas = std::min(error_px, limit_px) / sight.observation->sigma_px;
      verdict.score += sigmas * sigmas;
    }
    return verdict;
  }

  std::optional<Eigen::Vector3d> Locate(const TrackState& track,
                                        const std::vector<bool>& chosen) const {
    if (track.one_place) {
      Eigen::Vector3d sum = Eigen::Vector3d::Zero();
      for (std::size_t k = 0; k < chosen.size(); ++k) {
        if (!chosen[k]) continue;
        const Observation& observation = *track.sights[k].observation;
        sum += state_.frames[track.sights[k].frame].cam_from_world.Inverse() * observation.bearing /
               (observation.sigma_px * observation.sigma_px);
      }
      if (!(sum.norm() > 0.0)) return std::nullopt;
      return sum.normalized();
    }
    std::vector<Sighting> sightings;
    for (std::size_t k = 0; k < chosen.size(); ++k) {
      if (chosen[k]) {
        sightings.push_back(AsSighting(state_, track.sights[k], camera_.MeanFocal()));
      }
    }
    if (sightings.size() < 2) return std::nullopt;
    return Triangulate(sightings, min_angle_rad_);
  }

  // Pairs of sights, widest apart first.
  static std::vector<std::pair<int, int>> Pairs(int num_sights) {
    std::vector<std::pair<int, int>> pairs;
    for (int gap = num_sights - 1; gap > 0; --gap) {
      for (int a = 0; a + gap < num_sights; ++a) {
        pairs.emplace_back(a, a + gap);
        if (static_cast<int>(pairs.size()) == kMaxTrackHypotheses) return pairs;
      }
    }
    return pairs;
  }

  // Whether two of the used rays meet at the smallest angle allowed.
  bool IsDeep(const TrackState& track) const {
    std::vector<Eigen::Vector3d> rays;
    for (const Sight& sight : track.sights) {
      if (!sight.used) continue;
      rays.push_back(
          (track.position - state_.centers[state_.frames[sight.frame].center]).normalized());
    }
    for (std::size_t b = rays.size(); b-- > 0;) {
      for (std::size_t a = 0; a < b; ++a) {
        if (std::atan2(rays[a].cross(rays[b]).norm(), rays[a].dot(rays[b])) >= min_angle_rad_) {
          return true;
        }
      }
    }
    return false;
  }

  const Camera& camera_;
  const State& state_;
  double max_error_px_;
  int min_observations_;
  double min_angle_rad_;
};

// Takes frames out that are left with too few observations, then tracks that lose theirs, until
// nothing changes.
void RemoveWeakFrames(const Classifier& classifier, int min_observations, State& state) {
  for (bool changed = true; changed;) {
    std::vector<int> count(state.frames.size(), 0);
    for (const TrackState& track : state.tracks) {
      for (const Sight& sight : track.sights) count[sight.frame] += sight.used ? 1 : 0;
    }
    changed = false;
    for (std::size_t k = 0; k < state.frames.size(); ++k) {
      FrameState& frame = state.frames[k];
      if (frame.fixed || frame.weak || count[k] >= min_observations) continue;
      frame.weak = true;
      changed = true;
    }
    if (!changed) return;
    for (TrackState& track : state.tracks) {
      if (track.kind == TrackKind::kOut) continue;
      std::vector<bool> fits;
      for (const Sight& sight : track.sights) fits.push_back(sight.used);
      classifier.Accept(track, fits);
    }
  }
}

void ClassifyAll(const Camera& camera,
                 double max_error_px,
                 bool retriangulate,
                 const BundleOptions& options,
                 State& state) {
  const Classifier classifier(camera, state, max_error_px, options);
  if (retriangulate) {
    for (FrameState& frame : state.frames) frame.weak = false;
  }
  ParallelFor(static_cast<int>(state.tracks.size()), options.num_threads, [&](int k) {
    TrackState& track = state.tracks[k];
    retriangulate ? classifier.Classify(track) : classifier.Recheck(track);
  });
  RemoveWeakFrames(classifier, options.min_frame_observations, state);
}

ResidualStatistics Statistics(const Camera& camera, const State& state) {
  std::vector<double> errors_px;
  for (const TrackState& track : state.tracks) {
    if (track.kind != TrackKind::kPoint) continue;
    for (const Sight& sight : track.sights) {
      if (!sight.used) continue;
      errors_px.push_back(ErrorPx(camera, state, track, sight, track.position));
    }
  }
  ResidualStatistics statistics;
  statistics.num_observations = static_cast<int>(errors_px.size());
  if (errors_px.empty()) return statistics;
  std::sort(errors_px.begin(), errors_px.end());
  double sum = 0.0;
  double squares = 0.0;
  for (const double error_px : errors_px) {
    sum += error_px;
    squares += error_px * error_px;
  }
  const double count = static_cast<double>(errors_px.size());
  statistics.mean_px = sum / count;
  statistics.rms_px = std::sqrt(squares / count);
  statistics.median_px = errors_px[errors_px.size() / 2];
  statistics.p90_px = errors_px[errors_px.size() * 9 / 10];
  return statistics;
}

// ---- One minimisation ---------------------------------------------------------------------------

std::unique_ptr<ceres::LossFunction> MakeLoss(const BundleRound& round) {
  if (round.loss == "huber") return std::make_unique<ceres::HuberLoss>(round.loss_scale);
  if (round.loss == "cauchy") return std::make_unique<ceres::CauchyLoss>(round.loss_scale);
  return nullptr;
}

// The used observations as a Ceres problem over the state's own numbers.
class Minimisation {
 public:
  Minimisation(const Camera& camera, bool refine_rotations, const BundleRound& round, State& state)
      : camera_(camera),
        refine_rotations_(refine_rotations),
        state_(state),
        loss_(MakeLoss(round)),
        problem_(ProblemOptions()),
        camera_blocks_(3 * state.centers.size() + 4 * state.frames.size()),
        frame_used_(state.frames.size(), false),
        center_used_(state.centers.size(), false) {
    for (std::size_t k = 0; k < state.frames.size(); ++k) {
      const Eigen::Vector4d q = state.frames[k].cam_from_world.Quaternion().coeffs();
      std::copy_n(q.data(), 4, QuaternionBlock(k));
    }
    for (std::size_t c = 0; c < state.centers.size(); ++c) {
      std::copy_n(state.centers[c].data(), 3, CenterBlock(c));
    }
    ordering_ = std::make_shared<ceres::ParameterBlockOrdering>();
    AddResiduals();
    if (!Empty()) FixGauge();
  }

  bool Empty() const { return counts_.num_points == 0 || !moving_; }
  // Counts only; costs and times come from Solve.
  const BundleRoundSummary& Counts() const { return counts_; }

  ceres::Solver::Summary Solve(const BundleRound& round, int max_dense_frames) {
    ceres::Solver::Options options;
    options.linear_solver_type =
        counts_.num_frames <= max_dense_frames ? ceres::DENSE_SCHUR : ceres::SPARSE_SCHUR;
    options.sparse_linear_algebra_library_type = ceres::SUITE_SPARSE;
    options.linear_solver_ordering = ordering_;
    options.num_threads = 1;
    options.max_num_iterations = round.max_iterations;
    options.function_tolerance = round.function_tolerance;
    options.gradient_tolerance = 0.0;
    options.parameter_tolerance = 1e-12;
    options.max_trust_region_radius = kMaxTrustRegionRadius;
    options.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem_, &summary);
    TakeCameras();
    return summary;
  }

 private:
  static ceres::Problem::Options ProblemOptions() {
    ceres::Problem::Options options;
    options.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    options.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    options.disable_all_safety_checks = true;
    return options;
  }

  double* CenterBlock(std::size_t center) { return &camera_blocks_[3 * center]; }
  double* QuaternionBlock(std::size_t frame) {
    return &camera_blocks_[3 * state_.centers.size() + 4 * frame];
  }

  void AddResiduals() {
    for (TrackState& track : state_.tracks) {
      // With rotations held a direction has nothing to say.
      if (track.kind == TrackKind::kOut) continue;
      if (track.kind == TrackKind::kDirection && !refine_rotations_) continue;
      for (const Sight& sight : track.sights) {
        if (sight.used) AddObservation(track, sight);
      }
      ordering_->AddElementToGroup(track.position.data(), 0);
      (track.kind == TrackKind::kPoint ? counts_.num_points : counts_.num_directions) += 1;
    }
    for (std::size_t k = 0; k < state_.frames.size(); ++k) {
      if (!frame_used_[k]) continue;
      ++counts_.num_frames;
      problem_.SetManifold(QuaternionBlock(k), &manifold_);
      ordering_->AddElementToGroup(QuaternionBlock(k), 1);
    }
    for (std::size_t k = 0; k < state_.centers.size(); ++k) {
      if (center_used_[k]) ordering_->AddElementToGroup(CenterBlock(k), 1);
    }
  }

  void AddObservation(TrackState& track, const Sight& sight) {
    const FrameState& frame = state_.frames[sight.frame];
    double* const quaternion = QuaternionBlock(sight.frame);
    const Observation& observation = *sight.observation;
    frame_used_[sight.frame] = true;
    if (!frame.fixed) moving_ = true;
    ++counts_.num_observations;
    if (track.kind == TrackKind::kDirection) {
      directions_.emplace_back(camera_, observation.keypoint_px, observation.sigma_px);
      problem_.AddResidualBlock(
          &directions_.back(), loss_.get(), quaternion, track.position.data());
      return;
    }
    center_used_[frame.center] = true;
    points_.emplace_back(camera_, observation.keypoint_px, observation.sigma_px);
    problem_.AddResidualBlock(
        &points_.back(), loss_.get(), quaternion, CenterBlock(frame.center), track.position.data());
  }

  // Holds fixed frames, or else the first frame that sees points, and the scale where no two held
  // centres hold it already.
  void FixGauge() {
    std::vector<bool> held(state_.centers.size(), false);
    for (std::size_t k = 0; k < state_.frames.size(); ++k) {
      const FrameState& frame = state_.frames[k];
      if (frame.fixed) held[frame.center] = true;
      if (frame_used_[k] && (frame.fixed || !refine_rotations_)) {
        problem_.SetParameterBlockConstant(QuaternionBlock(k));
      }
    }
    for (std::size_t c = 0; c < held.size(); ++c) held[c] = held[c] && center_used_[c];
    int origin = -1;
    int num_held = 0;
    for (std::size_t c = 0; c < held.size(); ++c) {
      if (!held[c]) continue;
      problem_.SetParameterBlockConstant(CenterBlock(c));
      if (origin < 0) origin = static_cast<int>(c);
      ++num_held;
    }
    for (std::size_t k = 0; k < state_.frames.size() && origin < 0; ++k) {
      if (!frame_used_[k] || !center_used_[state_.frames[k].center]) continue;
      origin = state_.frames[k].center;
      problem_.SetParameterBlockConstant(CenterBlock(origin));
      problem_.SetParameterBlockConstant(QuaternionBlock(k));
    }
    if (num_held < 2) AnchorScale(origin);
  }

  void AnchorScale(int origin) {
    int farthest = -1;
    double largest = 0.0;
    for (std::size_t c = 0; c < state_.centers.size(); ++c) {
      const double distance = (state_.centers[c] - state_.centers[origin]).norm();
      if (!center_used_[c] || !(distance > largest)) continue;
      farthest = static_cast<int>(c);
      largest = distance;
    }
    if (farthest < 0) return;
    anchor_ = std::make_unique<ScaleAnchorCost>(
        state_.centers[origin], state_.centers[farthest], kScaleAnchorWeight);
    problem_.AddResidualBlock(anchor_.get(), nullptr, CenterBlock(farthest));
  }

  // Held rotations keep their last bit.
  void TakeCameras() {
    for (std::size_t c = 0; c < state_.centers.size(); ++c) {
      std::copy_n(CenterBlock(c), 3, state_.centers[c].data());
    }
    for (std::size_t k = 0; k < state_.frames.size(); ++k) {
      if (!frame_used_[k] || problem_.IsParameterBlockConstant(QuaternionBlock(k))) continue;
      const Eigen::Quaterniond q(QuaternionBlock(k));
      if (q.coeffs().allFinite()) state_.frames[k].cam_from_world = Rotation(q);
    }
  }

  const Camera& camera_;
  const bool refine_rotations_;
  State& state_;
  std::unique_ptr<ceres::LossFunction> loss_;
  LeftRotationManifold manifold_;
  std::deque<ReprojectionCost> points_;
  std::deque<DirectionCost> directions_;
  std::unique_ptr<ScaleAnchorCost> anchor_;
  ceres::Problem problem_;
  // Centres, then quaternions, in one piece of memory: Ceres sorts the blocks of a group by
  // address, and with it the order of elimination, which must not depend on where an allocation
  // lands.
  std::vector<double> camera_blocks_;
  std::vector<bool> frame_used_;
  std::vector<bool> center_used_;
  std::shared_ptr<ceres::ParameterBlockOrdering> ordering_;
  bool moving_ = false;
  BundleRoundSummary counts_;
};

// ---- The whole ----------------------------------------------------------------------------------

bool AllFinite(const State& state) {
  return std::all_of(state.centers.begin(), state.centers.end(), [](const Eigen::Vector3d& center) {
    return center.allFinite();
  });
}

// Classifies, minimises, and tells whether the next round may go on from here.
bool RunRound(const Camera& camera,
              const std::string& name,
              const BundleRound& round,
              const BundleOptions& options,
              State& state,
              BundleResult& result) {
  const auto start = std::chrono::steady_clock::now();
  ClassifyAll(camera, round.max_error_px, /*retriangulate=*/true, options, state);
  Minimisation minimisation(
      camera, round.refine_rotations && options.refine_rotations, round, state);
  if (minimisation.Empty()) {
    result.status = BundleStatus::kTooLittleData;
    result.message = "round " + name + " had no moving frame with at least " +
                     std::to_string(options.min_frame_observations) +
                     " observations of points that fit and have depth";
    return false;
  }
  if (result.summary.rounds.empty()) result.summary.before = Statistics(camera, state);
  const auto solver_start = std::chrono::steady_clock::now();
  const ceres::Solver::Summary solved = minimisation.Solve(round, options.max_dense_frames);

  BundleRoundSummary summary = minimisation.Counts();
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
void TakeResult(const BundleProblem& problem, const State& state, BundleResult& result) {
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
  CheckContract(problem, options);
  const auto start = std::chrono::steady_clock::now();
  State state = MakeState(problem);
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
  CheckContract(problem, options);
  State state = MakeState(problem);
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
