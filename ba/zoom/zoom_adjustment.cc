#include "ba/zoom/zoom_adjustment.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include <ceres/loss_function.h>
#include <ceres/problem.h>
#include <ceres/sized_cost_function.h>
#include <ceres/solver.h>

#include "ba/cost/reprojection_cost.h"
#include "ba/zoom/zoomed_projection.h"

namespace rotslam {
namespace {

// Of the logarithm of the focal length, by which it may speed up from one frame to the next: much
// more than keypoints leave open, and less than what a frame that shows next to nothing would say.
constexpr double kAcceleration = 0.02;

// Residual, in deviations, around which Cauchy's loss falls off.
constexpr double kZoomLossScale = 2.0;

constexpr int kMaxZoomSteps = 50;

// A frame's parameters.
struct ZoomBlocks {
  Rotation start;
  Eigen::Vector3d turn = Eigen::Vector3d::Zero();  // Exp(turn) * start
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  double log_scale = 0.0;

  ZoomedPose Pose() const { return {Rotation::Exp(turn) * start, center, log_scale}; }
};

// ZoomBlocks: turn, centre, logarithm of the scale, point.
class ZoomedCost final : public ceres::SizedCostFunction<2, 3, 3, 1, 3> {
 public:
  ZoomedCost(const Camera& camera,
             const Rotation& start,
             const Eigen::Vector2d& keypoint_px,
             double noise_px)
      : camera_(camera), start_(start), keypoint_px_(keypoint_px), noise_px_(noise_px) {}

  bool Evaluate(double const* const* parameters,
                double* residuals,
                double** jacobians) const override {
    using Vector = Eigen::Map<const Eigen::Vector3d>;
    const Eigen::Vector3d turn = Vector(parameters[0]);
    const ZoomedPose pose = {Rotation::Exp(turn) * start_, Vector(parameters[1]), parameters[2][0]};
    ZoomedJacobian J;
    const auto pixel = ProjectZoomed(camera_, pose, Vector(parameters[3]), &J);
    if (!pixel) return false;
    Eigen::Map<Eigen::Vector2d> difference(residuals);
    difference = (*pixel - keypoint_px_) / noise_px_;
    if (jacobians == nullptr) return true;
    using Rows3 = Eigen::Map<Eigen::Matrix<double, 2, 3, Eigen::RowMajor>>;
    if (jacobians[0] != nullptr) {
      (Rows3(jacobians[0])) = J.by_turn * LeftJacobian(turn) / noise_px_;
    }
    if (jacobians[1] != nullptr) (Rows3(jacobians[1])) = -J.by_point / noise_px_;
    if (jacobians[2] != nullptr) {
      Eigen::Map<Eigen::Vector2d> column(jacobians[2]);
      column = J.by_log_scale / noise_px_;
    }
    if (jacobians[3] != nullptr) (Rows3(jacobians[3])) = J.by_point / noise_px_;
    return true;
  }

 private:
  const Camera& camera_;
  Rotation start_;
  Eigen::Vector2d keypoint_px_;
  double noise_px_;
};

// Of three frames that follow one another.
class SmoothZoomCost final : public ceres::SizedCostFunction<1, 1, 1, 1> {
 public:
  bool Evaluate(double const* const* parameters,
                double* residuals,
                double** jacobians) const override {
    residuals[0] = (parameters[0][0] - 2.0 * parameters[1][0] + parameters[2][0]) / kAcceleration;
    if (jacobians == nullptr) return true;
    for (int k = 0; k < 3; ++k) {
      if (jacobians[k] != nullptr) jacobians[k][0] = (k == 1 ? -2.0 : 1.0) / kAcceleration;
    }
    return true;
  }
};

class SmoothZoom {
 public:
  explicit SmoothZoom(const ZoomProblem& input) : input_(input), points_(input.points) {
    for (const auto& [frame, pose] : input.poses) {
      blocks_[frame] = {
          pose.cam_from_world, Eigen::Vector3d::Zero(), pose.center_in_world, pose.log_scale};
    }
    AddObservations();
    AddSmoothness();
    HoldKnown();
  }

  std::map<FrameId, ZoomedPose> Run() {
    ceres::Solver::Options options;
    options.linear_solver_type = blocks_.size() > 100 ? ceres::SPARSE_SCHUR : ceres::DENSE_SCHUR;
    options.max_num_iterations = kMaxZoomSteps;
    options.function_tolerance = 1e-5;
    options.num_threads = 1;
    options.logging_type = ceres::SILENT;
    auto* ordering = new ceres::ParameterBlockOrdering;  // NOLINT: the options take it
    std::vector<double*> all;
    problem_.GetParameterBlocks(&all);
    for (double* block : all) ordering->AddElementToGroup(block, 1);
    for (auto& [track, point] : points_) {
      if (problem_.HasParameterBlock(point.data())) ordering->AddElementToGroup(point.data(), 0);
    }
    options.linear_solver_ordering.reset(ordering);
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem_, &summary);
    std::map<FrameId, ZoomedPose> poses;
    for (const auto& [frame, block] : blocks_) {
      poses[frame] = block.Pose();
      if (input_.alike.contains(frame)) poses[frame].log_scale = Alike().log_scale;
    }
    return poses;
  }

 private:
  ZoomBlocks& Alike() { return blocks_.at(*input_.alike.begin()); }
  double* LogScaleOf(FrameId frame) {
    return input_.alike.contains(frame) ? &Alike().log_scale : &blocks_.at(frame).log_scale;
  }

  void AddObservations() {
    auto* loss = new ceres::CauchyLoss(kZoomLossScale);  // NOLINT: the problem takes it
    for (const Track& track : input_.tracks) {
      const auto point = points_.find(track.id);
      if (point == points_.end()) continue;
      for (const Observation& seen : track.observations) {
        const auto found = blocks_.find(seen.frame);
        if (found == blocks_.end()) continue;
        // What is out of sight at the start stays out.
        if (!ProjectZoomed(input_.camera, found->second.Pose(), point->second)) continue;
        ZoomBlocks& block = found->second;
        problem_.AddResidualBlock(new ZoomedCost(  // NOLINT: the problem takes it
                                      input_.camera,
                                      block.start,
                                      seen.keypoint_px,
                                      input_.noise_px),
                                  loss,
                                  block.turn.data(),
                                  block.center.data(),
                                  LogScaleOf(seen.frame),
                                  point->second.data());
      }
    }
  }

  void AddSmoothness() {
    for (auto third = blocks_.begin(); third != blocks_.end(); ++third) {
      const FrameId last = third->first;
      const FrameId middle{last.value - 1};
      const FrameId first{last.value - 2};
      if (!blocks_.contains(middle) || !blocks_.contains(first)) continue;
      double* scales[3] = {LogScaleOf(first), LogScaleOf(middle), LogScaleOf(last)};
      if (scales[0] == scales[1] || scales[1] == scales[2]) continue;
      problem_.AddResidualBlock(new SmoothZoomCost,  // NOLINT: the problem takes both
                                new ceres::HuberLoss(1.0),
                                scales[0],
                                scales[1],
                                scales[2]);
    }
  }

  void Hold(double* block) {
    if (problem_.HasParameterBlock(block)) problem_.SetParameterBlockConstant(block);
  }

  void HoldKnown() {
    for (auto& [frame, block] : blocks_) {
      const bool is_known = input_.known.contains(frame);
      if (is_known) Hold(block.turn.data());
      if (is_known || !input_.moves) Hold(block.center.data());
      if (is_known || input_.unzoomed.contains(frame)) Hold(LogScaleOf(frame));
    }
  }

  const ZoomProblem& input_;
  std::map<FrameId, ZoomBlocks> blocks_;
  PointMap points_;
  ceres::Problem problem_;
};

}  // namespace

std::map<FrameId, ZoomedPose> AdjustZoom(const ZoomProblem& problem) {
  return SmoothZoom(problem).Run();
}

}  // namespace rotslam
