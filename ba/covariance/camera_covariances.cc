#include "ba/covariance/camera_covariances.h"

#include <cstddef>

#include <ceres/problem.h>
#include <ceres/sphere_manifold.h>

#include "ba/covariance/marginal_covariance.h"
#include "ba/problem/adjustment_problem.h"
#include "ba/problem/camera_blocks.h"

namespace rotslam {
namespace {

// The blocks that a frame's pose is made of, as far as they move.
std::vector<double*> MovingBlocks(std::size_t frame,
                                  const BundleState& state,
                                  AdjustmentProblem& problem) {
  CameraBlocks& cameras = problem.cameras();
  std::vector<double*> blocks;
  if (problem.Moves(cameras.Turn(frame))) blocks.push_back(cameras.Turn(frame));
  if (cameras.layout() == CameraLayout::kPose) return blocks;
  double* const center = cameras.Center(state.frames[frame].center);
  if (problem.Moves(center)) blocks.push_back(center);
  return blocks;
}

// The cameras' blocks that move, each once.
std::vector<double*> AllMovingBlocks(const BundleState& state, AdjustmentProblem& problem) {
  CameraBlocks& cameras = problem.cameras();
  std::vector<double*> moving;
  for (std::size_t k = 0; k < state.frames.size(); ++k) {
    if (problem.Moves(cameras.Turn(k))) moving.push_back(cameras.Turn(k));
  }
  if (cameras.layout() == CameraLayout::kPose) return moving;
  for (std::size_t c = 0; c < state.centers.size(); ++c) {
    if (problem.Moves(cameras.Center(c))) moving.push_back(cameras.Center(c));
  }
  return moving;
}

// Zero for what is held. Only rotations alone leave the lower half zero.
PoseCovariance OfPose(const Eigen::MatrixXd& moving, bool rotation_moves) {
  PoseCovariance covariance = PoseCovariance::Zero();
  const Eigen::Index first = rotation_moves ? 0 : 3;
  covariance.block(first, first, moving.rows(), moving.cols()) = moving;
  return covariance;
}

}  // namespace

std::optional<CameraCovariances> FindCovariances(const Camera& calibrated,
                                                 const BundleRound& round,
                                                 bool refine_lens,
                                                 const BundleOptions& options,
                                                 BundleState& state) {
  ceres::SphereManifold<3> directions;  // must outlive the problem
  AdjustmentProblem adjustment(calibrated, round, refine_lens, options, state);
  if (adjustment.Empty()) return std::nullopt;
  ceres::Problem& problem = adjustment.problem();
  CameraBlocks& cameras = adjustment.cameras();
  std::vector<double*> points;
  for (TrackState& track : state.tracks) {
    if (!problem.HasParameterBlock(track.position.data())) continue;
    points.push_back(track.position.data());
    // A direction's length means nothing.
    if (track.kind == TrackKind::kDirection) problem.SetManifold(points.back(), &directions);
  }
  std::vector<double*> moving = AllMovingBlocks(state, adjustment);
  std::vector<std::vector<double*>> groups;
  groups.reserve(state.frames.size() + 2);
  for (std::size_t k = 0; options.find_covariance && k < state.frames.size(); ++k) {
    groups.push_back(MovingBlocks(k, state, adjustment));
  }
  const std::size_t num_poses = groups.size();
  const int num_lens_blocks = refine_lens ? options.lens.NumBlocks() : 0;
  if (num_lens_blocks > 0) groups.emplace_back();
  for (int k = 0; k < num_lens_blocks; ++k) {
    moving.push_back(cameras.Lens() + k * kLensBlockSize);
    groups.back().push_back(moving.back());
  }
  const auto found = MarginalCovariances(problem, points, moving, groups);
  if (!found) return std::nullopt;
  CameraCovariances covariances;
  covariances.poses.resize(state.frames.size());
  for (std::size_t k = 0; k < num_poses; ++k) {
    if (!adjustment.IsUsed(k)) continue;
    covariances.poses[k] = OfPose((*found)[k], adjustment.Moves(cameras.Turn(k)));
  }
  if (num_lens_blocks > 0) {
    const int size = num_lens_blocks * kLensBlockSize;
    covariances.lens = LensCovariance::Zero();
    covariances.lens->topLeftCorner(size, size) = found->back();
  }
  return covariances;
}

}  // namespace rotslam
