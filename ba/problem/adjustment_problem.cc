#include "ba/problem/adjustment_problem.h"

#include <algorithm>
#include <array>

#include "ba/cost/loss.h"

namespace rotslam {
namespace {

// Weight of the scale anchor: a share of 1e-4 of the scale costs as much as one sigma. The optimum
// does not depend on it.
constexpr double kScaleAnchorWeight = 1e4;
// Standard deviation of a lens parameter that is held.
constexpr double kHeldSigma = 1e-7;

ceres::Problem::Options ProblemOptions(Followers& followers) {
  ceres::Problem::Options options;
  options.evaluation_callback = &followers;
  options.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  options.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  options.disable_all_safety_checks = true;
  return options;
}

}  // namespace

AdjustmentProblem::AdjustmentProblem(const Camera& calibrated,
                                     const BundleRound& round,
                                     bool refine_lens,
                                     const BundleOptions& options,
                                     BundleState& state)
    : calibrated_(calibrated),
      refine_rotations_(round.refine_rotations && options.refine_rotations),
      refine_lens_(refine_lens),
      state_(state),
      huber_bend_(round.loss == RobustLoss::kHuber ? round.loss_scale : 0.0),
      num_lens_blocks_(refine_lens ? options.lens.NumBlocks() : 0),
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
  AddRotationPriors();
  FixGauge();
  if (refine_lens_) FreeLens(options.lens);
}

void AdjustmentProblem::TakeNumbers(const LensOptions& options, int num_threads) {
  TakeCameras();
  for (std::size_t k = 0; k < state_.tracks.size(); ++k) {
    state_.tracks[k].position += strays_.AcceptedShift(k).shift;
  }
  TakeLens(options, num_threads);
}

void AdjustmentProblem::AddResiduals() {
  for (std::size_t k = 0; k < state_.tracks.size(); ++k) {
    TrackState& track = state_.tracks[k];
    // With rotations held a direction has nothing to say.
    if (track.kind == TrackKind::kOut) continue;
    if (track.kind == TrackKind::kDirection && !refine_rotations_) continue;
    for (const ObservationState& one : track.observations) {
      if (one.used) AddObservation(track, strays_.Shift(k), one);
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

void AdjustmentProblem::AddObservation(TrackState& track,
                                       const PointShift& shift,
                                       const ObservationState& one) {
  const FrameState& frame = state_.frames[one.frame];
  const Observation& observation = *one.observation;
  ObservationForm form;
  form.camera = cameras_.layout();
  form.at_infinity = track.kind == TrackKind::kDirection;
  form.num_lens_blocks = num_lens_blocks_;
  costs_.emplace_back(
      ReprojectionState{cameras_.camera(), calibrated_, cameras_.RotationOf(one.frame), shift},
      observation.keypoint_px,
      ScaleOf(state_, one),
      huber_bend_,
      form);
  std::array<double*, 5> blocks;
  int num_blocks = 0;
  if (refine_rotations_) blocks[num_blocks++] = cameras_.Turn(one.frame);
  if (!JointPoses() && !form.at_infinity) blocks[num_blocks++] = cameras_.Center(frame.center);
  blocks[num_blocks++] = track.position.data();
  for (int k = 0; k < num_lens_blocks_; ++k) {
    blocks[num_blocks++] = cameras_.Lens() + k * kLensBlockSize;
  }
  problem_.AddResidualBlock(&costs_.back(), loss_.get(), blocks.data(), num_blocks);
  frame_used_[one.frame] = true;
  if (!form.at_infinity) center_used_[frame.center] = true;
  if (!frame.fixed) moving_ = true;
  ++counts_.num_observations;
}

void AdjustmentProblem::AddRotationPriors() {
  if (!refine_rotations_) return;
  for (std::size_t k = 0; k < state_.frames.size(); ++k) {
    const FrameState& frame = state_.frames[k];
    if (!frame_used_[k] || frame.fixed || !(frame.prior_sigma_rad > 0.0)) continue;
    rotation_priors_.emplace_back(
        frame.cam_from_world, frame.prior_cam_from_world, frame.prior_sigma_rad);
    problem_.AddResidualBlock(&rotation_priors_.back(), nullptr, cameras_.Turn(k));
  }
}

// What is held is held by a tight prior: a block of another size would leave Ceres' specialised
// elimination.
void AdjustmentProblem::FreeLens(const LensOptions& options) {
  LensParameters sigmas = options.Sigmas(calibrated_.model);
  for (double& sigma : sigmas) sigma = std::max(sigma / state_.lens_noise, kHeldSigma);
  const LensParameters expected = LensOf(options.expected.value_or(calibrated_), calibrated_);
  for (int k = 0; k < num_lens_blocks_; ++k) {
    const int first = k * kLensBlockSize;
    lens_priors_.push_back(std::make_unique<LensPriorCost>(expected.segment<kLensBlockSize>(first),
                                                           sigmas.segment<kLensBlockSize>(first)));
    double* const block = cameras_.Lens() + first;
    problem_.AddResidualBlock(lens_priors_.back().get(), nullptr, block);
    ordering_->AddElementToGroup(block, 1);
  }
  cameras_.FreeLens();
}

// Holds fixed frames, or else the first one, and the scale where no two held centres hold it
// already.
void AdjustmentProblem::FixGauge() {
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
void AdjustmentProblem::HoldTurn(std::size_t frame) {
  if (refine_rotations_) problem_.SetParameterBlockConstant(cameras_.Turn(frame));
}

// The first frame that sees points. Where there are directions alone there is no centre to hold:
// the first rotation, if the caller holds none.
// @return  the frame's centre; -1 without points.
int AdjustmentProblem::HoldFirstFrame() {
  const bool has_points = counts_.num_points > 0;
  const auto used = [&](std::size_t k) {
    return has_points ? center_used_[state_.frames[k].center] : frame_used_[k];
  };
  for (std::size_t k = 0; k < state_.frames.size() && !has_points; ++k) {
    if (used(k) && state_.frames[k].fixed) return -1;
  }
  for (std::size_t k = 0; k < state_.frames.size(); ++k) {
    if (!frame_used_[k] || !used(k)) continue;
    // Priors hold the orientation of all.
    if (rotation_priors_.empty()) HoldTurn(k);
    if (!has_points) return -1;
    problem_.SetParameterBlockConstant(cameras_.BlockOfCenter(state_.frames[k].center));
    return state_.frames[k].center;
  }
  return -1;
}

void AdjustmentProblem::AnchorScale(int origin) {
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
void AdjustmentProblem::TakeCameras() {
  for (std::size_t c = 0; c < state_.centers.size(); ++c) {
    std::copy_n(cameras_.Center(c), 3, state_.centers[c].data());
  }
  for (std::size_t k = 0; k < state_.frames.size(); ++k) {
    if (!frame_used_[k] || !Moves(cameras_.Turn(k))) continue;
    if (!Eigen::Vector3d::Map(cameras_.Turn(k)).allFinite()) continue;
    state_.frames[k].cam_from_world = cameras_.Turned(k);
  }
}

// What was held keeps its last bit.
void AdjustmentProblem::TakeLens(const LensOptions& options, int num_threads) {
  LensParameters lens = LensParameters::Map(cameras_.Lens());
  if (!refine_lens_ || !lens.allFinite()) return;
  const LensParameters given = LensOf(calibrated_, calibrated_);
  const LensParameters sigmas = options.Sigmas(calibrated_.model);
  lens = (sigmas.array() > 0.0).select(lens, given);
  SetCamera(WithLens(calibrated_, lens), num_threads, state_);
}

}  // namespace rotslam
