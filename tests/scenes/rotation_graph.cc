#include "tests/scenes/rotation_graph.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "tests/scenes/scene.h"

namespace rotslam {
namespace {

std::vector<int> PartnersOf(int view, const RotationGraphOptions& options) {
  std::vector<int> partners;
  const int oldest = std::max(0, view - options.reach);
  if (options.keyframe_every > 0) {
    int keyframe = (std::max(0, oldest - 1) / options.keyframe_every) * options.keyframe_every;
    for (int k = 0; k < options.keyframe_reach && keyframe >= 0 && keyframe < oldest; ++k) {
      partners.push_back(keyframe);
      keyframe -= options.keyframe_every;
    }
  }
  std::reverse(partners.begin(), partners.end());
  for (int other = oldest; other < view; ++other) partners.push_back(other);
  return partners;
}

}  // namespace

RotationGraph MakeRotationGraph(const RotationGraphOptions& options) {
  SceneRandom random(options.seed);
  RotationGraph scene;
  for (int j = 0; j < options.num_views; ++j) {
    const FrameId view_j{j};
    if (j == 0) {
      scene.true_cam_from_world[view_j] = Rotation();
      scene.chained_cam_from_world[view_j] = Rotation();
      continue;
    }
    const Eigen::Vector3d turn = random.NormalVector(options.step_deg * kRadFromDeg);
    scene.true_cam_from_world[view_j] =
        Rotation::Exp(turn) * scene.true_cam_from_world[FrameId{j - 1}];
    for (const int i : PartnersOf(j, options)) {
      const FrameId view_i{i};
      RelativeRotation edge;
      edge.i = view_i;
      edge.j = view_j;
      const double sigma = options.noise_deg * kRadFromDeg;
      edge.j_from_i = Rotation::Exp(random.NormalVector(sigma)) *
                      scene.true_cam_from_world[view_j] *
                      scene.true_cam_from_world[view_i].Inverse();
      edge.covariance = (sigma * sigma + 1e-12) * Eigen::Matrix3d::Identity();
      edge.num_inliers = 500;
      const bool wrong = random.Uniform(0.0, 1.0) < options.wrong_ratio;
      const Eigen::Vector3d axis = random.NormalVector(1.0).normalized();
      const double angle = std::pow(60.0, random.Uniform(0.0, 1.0)) * kRadFromDeg;
      if (wrong && (options.wrong_steps || i != j - 1)) {
        edge.j_from_i = Rotation::Exp(angle * axis) * edge.j_from_i;
      }
      scene.graph.AddEdge(edge);
    }
    scene.chained_cam_from_world[view_j] = scene.graph.FindEdge(FrameId{j - 1}, view_j)->j_from_i *
                                           scene.chained_cam_from_world[FrameId{j - 1}];
  }
  return scene;
}

RotationErrors CompareRotations(const RotationMap& estimate, const RotationMap& truth) {
  RotationErrors errors;
  const Rotation first = estimate.begin()->second.Inverse() * truth.at(estimate.begin()->first);
  double sum = 0.0;
  double step_sum = 0.0;
  const Rotation* last = nullptr;
  const Rotation* last_true = nullptr;
  for (const auto& [view, cam_from_world] : estimate) {
    const Rotation& true_cam_from_world = truth.at(view);
    const double error = (cam_from_world * first * true_cam_from_world.Inverse()).AngleDeg();
    sum += error * error;
    errors.max_deg = std::max(errors.max_deg, error);
    if (last != nullptr) {
      const Rotation step = cam_from_world * last->Inverse();
      const Rotation true_step = true_cam_from_world * last_true->Inverse();
      const double step_error = (step * true_step.Inverse()).AngleDeg();
      step_sum += step_error * step_error;
    }
    last = &cam_from_world;
    last_true = &true_cam_from_world;
  }
  const double count = static_cast<double>(estimate.size());
  errors.rms_deg = std::sqrt(sum / count);
  errors.step_rms_deg = std::sqrt(step_sum / std::max(1.0, count - 1.0));
  return errors;
}

}  // namespace rotslam
