#include "ba/minimisation.h"

#include <algorithm>
#include <array>
#include <deque>
#include <memory>
#include <memory_resource>
#include <vector>

#include <ceres/evaluation_callback.h>
#include <ceres/iteration_callback.h>
#include <ceres/ordered_groups.h>
#include <ceres/problem.h>
#include <ceres/sphere_manifold.h>

#include "ba/lens.h"
#include "ba/loss.h"
#include "ba/marginal_covariance.h"
#include "ba/reprojection_cost.h"
#include "ba/stray_points.h"

namespace rotslam {
namespace {

// Weight of the scale anchor: a share of 1e-4 of the scale costs as much as one sigma. The optimum
// does not depend on it.
constexpr double kScaleAnchorWeight = 1e4;
// Of a part of the lens that does not move.
constexpr double kHeldSigma = 1e-7;
// Keeps Levenberg-Marquardt's damping above rounding, for what the data leave open: the length of
// directions, scale and place of parts that share no track.
constexpr double kMaxTrustRegionRadius = 1e10;

// Whether some frames stand at one place.
bool SharesCenters(const BundleState& state) {
  std::vector<bool> taken(state.centers.size(), false);
  return std::any_of(state.frames.begin(), state.frames.end(), [&](const FrameState& frame) {
    const bool shared = taken[frame.center];
    taken[frame.center] = true;
    return shared;
  });
}

// The cameras' numbers and the lens', in one piece of memory: Ceres sorts the blocks of a group by
// address, and with it the order of elimination, which must not depend on where an allocation
// lands. Poses are one block each, for which Ceres has its specialised elimination of points; only
// frames that share a centre need those.
class CameraBlocks {
 public:
  CameraBlocks(const BundleState& state, const Camera& calibrated, bool turns)
      : layout_(!turns                 ? CameraLayout::kCenter
                : SharesCenters(state) ? CameraLayout::kApart
                                       : CameraLayout::kPose),
        num_centers_(state.centers.size()),
        frame_of_center_(state.centers.size(), 0),
        numbers_(3 * state.centers.size() + (turns ? 3 * state.frames.size() : 0) + kLensSize),
        camera_(state.camera),
        calibrated_(calibrated) {
    LensParameters::Map(Lens()) = LensOf(state.camera, calibrated);
    rotations_.reserve(state.frames.size());
    for (std::size_t k = 0; k < state.frames.size(); ++k) {
      rotations_.emplace_back(state.frames[k].cam_from_world);
      frame_of_center_[state.frames[k].center] = k;
    }
    for (std::size_t c = 0; c < num_centers_; ++c) {
      std::copy_n(state.centers[c].data(), 3, Center(c));
    }
  }

  // As the numbers say: what many observations have in common.
  void Follow() {
    for (std::size_t k = 0; k < rotations_.size() && layout_ != CameraLayout::kCenter; ++k) {
      rotations_[k].Turn(TurnOf(k));
    }
    if (moves_lens_) camera_ = WithLens(calibrated_, LensParameters::Map(Lens()));
  }

  CameraLayout layout() const { return layout_; }
  // Of a frame; with kPose the whole pose, with kCenter null.
  double* Turn(std::size_t frame) {
    switch (layout_) {
      case CameraLayout::kPose:
        return &numbers_[6 * frame];
      case CameraLayout::kApart:
        return &numbers_[3 * (num_centers_ + frame)];
      case CameraLayout::kCenter:
        break;
    }
    return nullptr;
  }
  double* Center(std::size_t center) {
    if (layout_ == CameraLayout::kPose) return Turn(frame_of_center_[center]) + 3;
    return &numbers_[3 * center];
  }
  // The parameter block that has a centre in it.
  double* BlockOfCenter(std::size_t center) {
    if (layout_ == CameraLayout::kPose) return Turn(frame_of_center_[center]);
    return Center(center);
  }
  // As of the last evaluation.
  std::vector<StrayPoints::Pose> Poses(const BundleState& state) {
    std::vector<StrayPoints::Pose> poses;
    poses.reserve(state.frames.size());
    for (std::size_t k = 0; k < state.frames.size(); ++k) {
      poses.push_back(
          {rotations_[k].Matrix(), Eigen::Vector3d::Map(Center(state.frames[k].center))});
    }
    return poses;
  }
  double* Lens() { return &numbers_[numbers_.size() - kLensSize]; }
  void FreeLens() { moves_lens_ = true; }

  // As of the last evaluation.
  const Camera& camera() const { return camera_; }
  const TurnedRotation& RotationOf(std::size_t frame) const { return rotations_[frame]; }
  // As the numbers say.
  Rotation Turned(std::size_t frame) { return rotations_[frame].At(TurnOf(frame)); }

 private:
  static constexpr std::size_t kLensSize = LensParameters::SizeAtCompileTime;

  Eigen::Vector3d TurnOf(std::size_t frame) { return Eigen::Vector3d::Map(Turn(frame)); }

  CameraLayout layout_;
  std::size_t num_centers_;
  std::vector<std::size_t> frame_of_center_;
  std::vector<double> numbers_;
  std::vector<TurnedRotation> rotations_;
  Camera camera_;
  const Camera& calibrated_;
  bool moves_lens_ = false;
};

// What observations have in common, and stray points, follow the solver's numbers.
class Followers final : public ceres::EvaluationCallback, public ceres::IterationCallback {
 public:
  Followers(const BundleState& state, CameraBlocks& cameras, StrayPoints& strays)
      : state_(state), cameras_(cameras), strays_(strays) {}

  // Before each evaluation. Derivatives are asked for where the solver starts, and of what it has
  // accepted.
  void PrepareForEvaluation(bool evaluate_jacobians, bool new_evaluation_point) override {
    if (!new_evaluation_point) return;
    cameras_.Follow();
    if (evaluate_jacobians) {
      strays_.Start(cameras_.Poses(state_));
    } else {
      strays_.Try(cameras_.Poses(state_));
    }
  }

  // After each step.
  ceres::CallbackReturnType operator()(const ceres::IterationSummary& step) override {
    if (step.iteration > 0 && step.step_is_successful) strays_.Accept();
    return ceres::SOLVER_CONTINUE;
  }

 private:
  const BundleState& state_;
  CameraBlocks& cameras_;
  StrayPoints& strays_;
};

// Ends a minimisation when what is still to come is less than a share of the cost, if each step
// goes on to gain a part of what the one before gained. Ceres itself works a whole step out to see
// that it was not worth it.
class Arrival final : public ceres::IterationCallback {
 public:
  explicit Arrival(double tolerance) : tolerance_(tolerance) {}

  ceres::CallbackReturnType operator()(const ceres::IterationSummary& step) override {
    if (step.iteration == 0 || !step.step_is_successful) return ceres::SOLVER_CONTINUE;
    const double ratio = gain_ > 0.0 ? step.cost_change / gain_ : 1.0;
    // Of the last two: the first steps gain quadratically, the later ones do not.
    const double slower = std::max(ratio, ratio_);
    gain_ = step.cost_change;
    ratio_ = ratio < 1.0 ? ratio : 0.0;
    const bool ends = slower < 1.0 && gain_ * slower / (1.0 - slower) < tolerance_ * step.cost;
    return ends ? ceres::SOLVER_TERMINATE_SUCCESSFULLY : ceres::SOLVER_CONTINUE;
  }

 private:
  double tolerance_;
  double gain_ = 0.0;   // of the last step
  double ratio_ = 0.0;  // of its gain to that of the one before
};

// The used observations as a Ceres problem over the state's own numbers.
class Minimisation {
 public:
  Minimisation(const Camera& calibrated,
               const BundleRound& round,
               bool refine_lens,
               const BundleOptions& options,
               BundleState& state)
      : calibrated_(calibrated),
        refine_rotations_(round.refine_rotations && options.refine_rotations),
        refine_lens_(refine_lens),
        state_(state),
        huber_bend_(round.loss == "huber" ? round.loss_scale : 0.0),
        loss_(huber_bend_ > 0.0 ? nullptr : MakeLoss(round)),
        cameras_(state, calibrated, refine_rotations_),
        strays_(state, options.min_angle_deg * kRadFromDeg, options.num_threads),
        followers_(state, cameras_, strays_),
        problem_(ProblemOptions(followers_)),
        frame_used_(state.frames.size(), false),
        center_used_(state.centers.size(), false) {
    ordering_ = std::make_shared<ceres::ParameterBlockOrdering>();
    AddResiduals();
    if (Empty()) return;
    FixGauge();
    if (refine_lens_) FreeLens(options.lens);
  }

  bool Empty() const { return counts_.num_points + counts_.num_directions == 0 || !moving_; }
  // Counts only; costs and times come from Solve.
  const BundleRoundSummary& Counts() const { return counts_; }

  ceres::Solver::Summary Solve(const BundleRound& round, const BundleOptions& bundle_options) {
    ceres::Solver::Options options;
    options.linear_solver_type = counts_.num_frames <= bundle_options.max_dense_frames
                                     ? ceres::DENSE_SCHUR
                                     : ceres::SPARSE_SCHUR;
    options.sparse_linear_algebra_library_type = ceres::SUITE_SPARSE;
    options.linear_solver_ordering = ordering_;
    options.num_threads = 1;
    options.max_num_iterations = round.max_iterations;
    options.function_tolerance = round.function_tolerance;
    options.gradient_tolerance = 0.0;
    options.parameter_tolerance = 1e-12;
    options.initial_trust_region_radius = round.initial_radius;
    options.max_trust_region_radius = kMaxTrustRegionRadius;
    options.logging_type = ceres::SILENT;
    options.callbacks.push_back(&followers_);
    Arrival arrival(round.function_tolerance);
    options.callbacks.push_back(&arrival);
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem_, &summary);
    TakeCameras();
    for (std::size_t k = 0; k < state_.tracks.size(); ++k) {
      state_.tracks[k].position += strays_.AcceptedShift(k).shift;
    }
    TakeLens(bundle_options.lens, bundle_options.num_threads);
    return summary;
  }

  // The problem may not be solved any more afterwards.
  std::optional<CameraCovariances> Covariances() {
    std::vector<double*> points;
    for (TrackState& track : state_.tracks) {
      if (!problem_.HasParameterBlock(track.position.data())) continue;
      points.push_back(track.position.data());
      // A direction's length means nothing.
      if (track.kind == TrackKind::kDirection) problem_.SetManifold(points.back(), &directions_);
    }
    std::vector<double*> moving;
    for (std::size_t k = 0; k < state_.frames.size(); ++k) {
      if (Moves(cameras_.Turn(k))) moving.push_back(cameras_.Turn(k));
    }
    for (std::size_t c = 0; c < state_.centers.size() && !JointPoses(); ++c) {
      if (Moves(cameras_.Center(c))) moving.push_back(cameras_.Center(c));
    }
    std::vector<std::vector<double*>> groups;
    groups.reserve(state_.frames.size() + 1);
    for (std::size_t k = 0; k < state_.frames.size(); ++k) groups.push_back(MovingBlocks(k));
    if (refine_lens_) {
      moving.push_back(cameras_.Lens());
      groups.push_back({cameras_.Lens()});
    }
    const auto found = MarginalCovariances(problem_, points, moving, groups);
    if (!found) return std::nullopt;
    CameraCovariances covariances;
    covariances.poses.resize(state_.frames.size());
    for (std::size_t k = 0; k < state_.frames.size(); ++k) {
      if (frame_used_[k]) covariances.poses[k] = OfPose((*found)[k], k);
    }
    if (refine_lens_) covariances.lens = found->back();
    return covariances;
  }

 private:
  static ceres::Problem::Options ProblemOptions(Followers& followers) {
    ceres::Problem::Options options;
    options.evaluation_callback = &followers;
    options.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    options.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    options.disable_all_safety_checks = true;
    return options;
  }

  bool Moves(const double* block) const {
    return block != nullptr && problem_.HasParameterBlock(block) &&
           !problem_.IsParameterBlockConstant(block);
  }

  bool JointPoses() const { return cameras_.layout() == CameraLayout::kPose; }

  // The blocks that a frame's pose is made of, as far as they move.
  std::vector<double*> MovingBlocks(std::size_t frame) {
    std::vector<double*> blocks;
    if (Moves(cameras_.Turn(frame))) blocks.push_back(cameras_.Turn(frame));
    if (JointPoses()) return blocks;
    double* const center = cameras_.Center(state_.frames[frame].center);
    if (Moves(center)) blocks.push_back(center);
    return blocks;
  }

  // Zero for what is held. Only rotations alone leave the lower half zero.
  PoseCovariance OfPose(const Eigen::MatrixXd& moving, std::size_t frame) {
    PoseCovariance covariance = PoseCovariance::Zero();
    const Eigen::Index first = Moves(cameras_.Turn(frame)) ? 0 : 3;
    covariance.block(first, first, moving.rows(), moving.cols()) = moving;
    return covariance;
  }

  void AddResiduals() {
    for (std::size_t k = 0; k < state_.tracks.size(); ++k) {
      TrackState& track = state_.tracks[k];
      // With rotations held a direction has nothing to say.
      if (track.kind == TrackKind::kOut) continue;
      if (track.kind == TrackKind::kDirection && !refine_rotations_) continue;
      for (const Sight& sight : track.sights) {
        if (sight.used) AddObservation(track, strays_.Shift(k), sight);
      }
      ordering_->AddElementToGroup(track.position.data(), 0);
      (track.kind == TrackKind::kPoint ? counts_.num_points : counts_.num_directions) += 1;
    }
    for (std::size_t k = 0; k < state_.frames.size(); ++k) {
      if (!frame_used_[k]) continue;
      ++counts_.num_frames;
      if (refine_rotations_) ordering_->AddElementToGroup(cameras_.Turn(k), 1);
    }
    if (JointPoses()) return;
    for (std::size_t c = 0; c < state_.centers.size(); ++c) {
      if (center_used_[c]) ordering_->AddElementToGroup(cameras_.Center(c), 1);
    }
  }

  void AddObservation(TrackState& track, const PointShift& shift, const Sight& sight) {
    const FrameState& frame = state_.frames[sight.frame];
    const Observation& observation = *sight.observation;
    ObservationForm form;
    form.camera = cameras_.layout();
    form.at_infinity = track.kind == TrackKind::kDirection;
    form.moves_lens = refine_lens_;
    costs_.emplace_back(cameras_.camera(),
                        calibrated_,
                        cameras_.RotationOf(sight.frame),
                        shift,
                        observation.keypoint_px,
                        ScaleOf(state_, sight),
                        huber_bend_,
                        form);
    std::array<double*, 4> blocks;
    int num_blocks = 0;
    if (refine_rotations_) blocks[num_blocks++] = cameras_.Turn(sight.frame);
    if (!JointPoses() && !form.at_infinity) blocks[num_blocks++] = cameras_.Center(frame.center);
    blocks[num_blocks++] = track.position.data();
    if (form.moves_lens) blocks[num_blocks++] = cameras_.Lens();
    problem_.AddResidualBlock(&costs_.back(), loss_.get(), blocks.data(), num_blocks);
    frame_used_[sight.frame] = true;
    if (!form.at_infinity) center_used_[frame.center] = true;
    if (!frame.fixed) moving_ = true;
    ++counts_.num_observations;
  }

  // What is held is held by a tight prior: a block of another size would leave Ceres' specialised
  // elimination.
  void FreeLens(const LensOptions& options) {
    const double focal = options.refine_focal ? options.focal_sigma : kHeldSigma;
    const double center = options.refine_principal_point ? options.principal_sigma : kHeldSigma;
    const double bend = options.refine_distortion ? options.distortion_sigma : kHeldSigma;
    LensParameters sigmas;
    sigmas << focal, kHeldSigma, center, center, bend, bend;
    lens_prior_ = std::make_unique<LensPriorCost>(LensOf(calibrated_, calibrated_), sigmas);
    problem_.AddResidualBlock(lens_prior_.get(), nullptr, cameras_.Lens());
    ordering_->AddElementToGroup(cameras_.Lens(), 1);
    cameras_.FreeLens();
  }

  void TakeLens(const LensOptions& options, int num_threads) {
    LensParameters lens = LensParameters::Map(cameras_.Lens());
    if (!refine_lens_ || !lens.allFinite()) return;
    const LensParameters given = LensOf(calibrated_, calibrated_);
    lens[1] = given[1];
    if (!options.refine_focal) lens[0] = given[0];
    if (!options.refine_principal_point) lens.segment<2>(2) = given.segment<2>(2);
    if (!options.refine_distortion) lens.tail<2>() = given.tail<2>();
    SetCamera(WithLens(calibrated_, lens), num_threads, state_);
  }

  // Holds fixed frames, or else the first one, and the scale where no two held centres hold it
  // already.
  void FixGauge() {
    std::vector<bool> held(state_.centers.size(), false);
    for (std::size_t k = 0; k < state_.frames.size(); ++k) {
      const FrameState& frame = state_.frames[k];
      if (frame.fixed) held[frame.center] = true;
      if (frame_used_[k] && frame.fixed) HoldTurn(k);
    }
    for (std::size_t c = 0; c < held.size(); ++c) held[c] = held[c] && center_used_[c];
    int origin = -1;
    int num_held = 0;
    for (std::size_t c = 0; c < held.size(); ++c) {
      if (!held[c]) continue;
      problem_.SetParameterBlockConstant(cameras_.BlockOfCenter(c));
      if (origin < 0) origin = static_cast<int>(c);
      ++num_held;
    }
    if (origin < 0) origin = HoldFirstFrame();
    if (origin >= 0 && num_held < 2) AnchorScale(origin);
  }

  // A held pose is held whole.
  void HoldTurn(std::size_t frame) {
    if (refine_rotations_) problem_.SetParameterBlockConstant(cameras_.Turn(frame));
  }

  // The first frame that sees points. Where there are directions alone there is no centre to hold:
  // the first rotation, if the caller holds none.
  // @return  the frame's centre; -1 without points.
  int HoldFirstFrame() {
    const bool has_points = counts_.num_points > 0;
    const auto used = [&](std::size_t k) {
      return has_points ? center_used_[state_.frames[k].center] : frame_used_[k];
    };
    for (std::size_t k = 0; k < state_.frames.size() && !has_points; ++k) {
      if (used(k) && state_.frames[k].fixed) return -1;
    }
    for (std::size_t k = 0; k < state_.frames.size(); ++k) {
      if (!frame_used_[k] || !used(k)) continue;
      HoldTurn(k);
      if (!has_points) return -1;
      problem_.SetParameterBlockConstant(cameras_.BlockOfCenter(state_.frames[k].center));
      return state_.frames[k].center;
    }
    return -1;
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
        state_.centers[origin], state_.centers[farthest], kScaleAnchorWeight, cameras_.layout());
    problem_.AddResidualBlock(anchor_.get(), nullptr, cameras_.BlockOfCenter(farthest));
  }

  // Held rotations keep their last bit.
  void TakeCameras() {
    for (std::size_t c = 0; c < state_.centers.size(); ++c) {
      std::copy_n(cameras_.Center(c), 3, state_.centers[c].data());
    }
    for (std::size_t k = 0; k < state_.frames.size(); ++k) {
      if (!frame_used_[k] || !Moves(cameras_.Turn(k))) continue;
      if (!Eigen::Vector3d::Map(cameras_.Turn(k)).allFinite()) continue;
      state_.frames[k].cam_from_world = cameras_.Turned(k);
    }
  }

  const Camera& calibrated_;
  const bool refine_rotations_;
  const bool refine_lens_;
  BundleState& state_;
  const double huber_bend_;                    // 0: another loss
  std::unique_ptr<ceres::LossFunction> loss_;  // null: Huber's, or none
  ceres::SphereManifold<3> directions_;
  // One piece for all: they come and go together.
  std::pmr::monotonic_buffer_resource memory_of_costs_;
  std::pmr::deque<ReprojectionCost> costs_{&memory_of_costs_};
  std::unique_ptr<LensPriorCost> lens_prior_;
  std::unique_ptr<ScaleAnchorCost> anchor_;
  CameraBlocks cameras_;
  StrayPoints strays_;
  Followers followers_;
  ceres::Problem problem_;
  std::vector<bool> frame_used_;
  std::vector<bool> center_used_;
  std::shared_ptr<ceres::ParameterBlockOrdering> ordering_;
  bool moving_ = false;
  BundleRoundSummary counts_;
};

}  // namespace

std::optional<MinimisationResult> Minimise(const Camera& calibrated,
                                           const BundleRound& round,
                                           bool refine_lens,
                                           const BundleOptions& options,
                                           BundleState& state) {
  Minimisation minimisation(calibrated, round, refine_lens, options, state);
  if (minimisation.Empty()) return std::nullopt;
  MinimisationResult result;
  result.counts = minimisation.Counts();
  result.solver = minimisation.Solve(round, options);
  return result;
}

std::optional<CameraCovariances> FindCovariances(const Camera& calibrated,
                                                 const BundleRound& round,
                                                 bool refine_lens,
                                                 const BundleOptions& options,
                                                 BundleState& state) {
  Minimisation minimisation(calibrated, round, refine_lens, options, state);
  if (minimisation.Empty()) return std::nullopt;
  return minimisation.Covariances();
}

}  // namespace rotslam
