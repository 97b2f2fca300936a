#pragma once

#include <cstddef>
#include <deque>
#include <memory>
#include <memory_resource>
#include <vector>

#include <ceres/evaluation_callback.h>
#include <ceres/iteration_callback.h>
#include <ceres/loss_function.h>
#include <ceres/ordered_groups.h>
#include <ceres/problem.h>

#include "ba/cost/lens_prior.h"
#include "ba/cost/reprojection_cost.h"
#include "ba/cost/rotation_prior.h"
#include "ba/problem/bundle_state.h"
#include "ba/problem/camera_blocks.h"
#include "ba/problem/stray_points.h"
#include "ba/types/bundle_options.h"
#include "ba/types/bundle_result.h"
#include "rotodom/camera/camera.h"

namespace rotslam {

/// Updates the values that observations share, and stray points, when the solver has moved.
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

/// The used observations as a Ceres problem over the state's own numbers.
class AdjustmentProblem {
 public:
  /// @param calibrated   the camera as it was given, to which priors hold the lens.
  /// @param round        its loss, and whether rotations move.
  /// @param refine_lens  as far as `options.lens` lets it.
  /// `calibrated` and `state` must outlive this.
  AdjustmentProblem(const Camera& calibrated,
                    const BundleRound& round,
                    bool refine_lens,
                    const BundleOptions& options,
                    BundleState& state);

  /// Whether no frame that may move sees anything.
  bool Empty() const { return counts_.num_points + counts_.num_directions == 0 || !moving_; }
  /// Frames, points, directions and observations; no costs.
  const BundleRoundSummary& Counts() const { return counts_; }

  ceres::Problem& problem() { return problem_; }
  /// Points and directions first, then cameras and the lens.
  const std::shared_ptr<ceres::ParameterBlockOrdering>& ordering() const { return ordering_; }
  /// To be called after each step.
  ceres::IterationCallback& followers() { return followers_; }

  /// Takes the solver's numbers over into the state; what was held keeps its last bit.
  void TakeNumbers(const LensOptions& options, int num_threads);

  /// Whether a parameter block is in the problem and not held.
  bool Moves(const double* block) const {
    return block != nullptr && problem_.HasParameterBlock(block) &&
           !problem_.IsParameterBlockConstant(block);
  }
  /// Whether a frame has used observations.
  bool IsUsed(std::size_t frame) const { return frame_used_[frame]; }
  CameraBlocks& cameras() { return cameras_; }

 private:
  bool JointPoses() const { return cameras_.layout() == CameraLayout::kPose; }
  void AddResiduals();
  void AddObservation(TrackState& track, const PointShift& shift, const ObservationState& one);
  void AddRotationPriors();
  void FreeLens(const LensOptions& options);
  void FixGauge();
  void HoldTurn(std::size_t frame);
  int HoldFirstFrame();
  void AnchorScale(int origin);
  void TakeCameras();
  void TakeLens(const LensOptions& options, int num_threads);

  const Camera& calibrated_;
  const bool refine_rotations_;
  const bool refine_lens_;
  BundleState& state_;
  const double huber_bend_;  // 0: another loss
  const int num_lens_blocks_;
  std::unique_ptr<ceres::LossFunction> loss_;  // null: Huber's, or none
  // One piece for all: they come and go together.
  std::pmr::monotonic_buffer_resource memory_of_costs_;
  std::pmr::deque<ReprojectionCost> costs_{&memory_of_costs_};
  std::vector<std::unique_ptr<LensPriorCost>> lens_priors_;
  std::deque<RotationPriorCost> rotation_priors_;
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

}  // namespace rotslam
