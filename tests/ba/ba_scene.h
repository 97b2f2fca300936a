#pragma once

#include <cstdint>
#include <random>

#include "ba/bundle_adjustment.h"

namespace rotslam {

inline Camera BaCamera(CameraModel model = CameraModel::kPinhole) {
  Camera camera;
  camera.model = model;
  camera.width = 1240;
  camera.height = 376;
  camera.fx = 718.0;
  camera.fy = 715.0;
  camera.cx = 607.0;
  camera.cy = 185.0;
  if (model == CameraModel::kRadtan) camera.distortion = {-0.12, 0.05, 1e-3, -5e-4, 0.01};
  if (model == CameraModel::kEquidistant) camera.distortion = {-0.02, 0.01, -0.004, 1e-3, 0.0};
  if (model == CameraModel::kRational) {
    camera.distortion = {0.4, 0.1, 1e-3, -5e-4, 0.02, 0.5, 0.15, 0.03};
  }
  if (model == CameraModel::kFov) camera.distortion = {0.8};
  return camera;
}

/// A camera driving along a gently turning street, points on both sides.
struct BaSceneOptions {
  int num_frames = 20;
  int num_points = 400;
  double spacing = 1.0;  // path length per frame
  double noise_px = 0.0;
  double outlier_ratio = 0.0;  // of observations, 15 to 150 px off
  int still_first = 0;         // frames still_first .. still_last rotate in place
  int still_last = -1;
  std::uint32_t seed = 1;
  Camera camera = BaCamera();
};

struct BaScene {
  Camera camera;
  Reconstruction truth;  // with noisy observations
  std::set<std::pair<TrackId, FrameId>> outliers;
};

inline BaScene MakeBaScene(const BaSceneOptions& options) {
  std::mt19937 random(options.seed);
  const auto uniform = [&](double low, double high) {
    return low + (high - low) * (static_cast<double>(random()) / 4294967296.0);
  };
  const auto normal = [&] {  // Box-Muller: the same on every standard library
    const double u = uniform(1e-12, 1.0);
    return std::sqrt(-2.0 * std::log(u)) * std::cos(uniform(0.0, 2.0 * std::numbers::pi));
  };
  BaScene scene;
  scene.camera = options.camera;
  double heading = 0.0;
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  for (int k = 0; k < options.num_frames; ++k) {
    const FrameId frame{k};
    const bool still = k > options.still_first && k <= options.still_last;
    if (k > 0) {
      heading += (still ? 6.0 : 1.0) * kRadFromDeg * std::sin(0.3 * k + 0.5);
      if (!still) {
        center += options.spacing *
                  Eigen::Vector3d(std::sin(heading), 0.02 * std::sin(1.3 * k), std::cos(heading));
      }
    }
    scene.truth.cam_from_world[frame] =
        Rotation::Exp({0.01 * std::sin(0.7 * k), 0.0, 0.01 * std::cos(0.9 * k)}) *
        Rotation::Exp({0.0, -heading, 0.0});
    scene.truth.center_in_world[frame] = center;
  }
  while (static_cast<int>(scene.truth.tracks.size()) < options.num_points) {
    const TrackId id{static_cast<int>(scene.truth.tracks.size())};
    // Beside or above some frame's path, some metres ahead.
    const FrameId near{static_cast<int>(uniform(0.0, options.num_frames - 0.01))};
    const double side = (random() & 1U) != 0U ? 1.0 : -1.0;
    const Eigen::Vector3d in_cam(side * uniform(1.5, 9.0), uniform(-4.0, 1.5), uniform(6.0, 40.0));
    const Eigen::Vector3d point =
        scene.truth.cam_from_world[near].Inverse() * in_cam + scene.truth.center_in_world[near];
    Track track;
    track.id = id;
    for (const auto& [frame, cam_from_world] : scene.truth.cam_from_world) {
      if (frame < near || frame.value > near.value + 9) continue;
      const Eigen::Vector3d p = cam_from_world * (point - scene.truth.center_in_world[frame]);
      const auto pixel = p.z() > 1.0 ? scene.camera.Project(p) : std::nullopt;
      if (!pixel || pixel->x() < 0.0 || pixel->x() >= scene.camera.width || pixel->y() < 0.0 ||
          pixel->y() >= scene.camera.height) {
        continue;
      }
      Observation observation;
      observation.frame = frame;
      observation.keypoint_px = *pixel + options.noise_px * Eigen::Vector2d(normal(), normal());
      if (uniform(0.0, 1.0) < options.outlier_ratio) {
        const double angle = uniform(0.0, 2.0 * std::numbers::pi);
        observation.keypoint_px +=
            uniform(15.0, 150.0) * Eigen::Vector2d(std::cos(angle), std::sin(angle));
        scene.outliers.insert({id, frame});
      }
      observation.bearing = *scene.camera.Unproject(observation.keypoint_px);
      track.observations.push_back(observation);
    }
    if (track.observations.size() < 3) continue;
    scene.truth.tracks.push_back(track);
    scene.truth.point_in_world[id] = point;
  }
  return scene;
}

/// The problem one has after known-rotation positions: rotations a little off, centres bent away
/// from the truth along the path, no points.
inline BundleProblem PerturbedProblem(const BaScene& scene, double angle_deg, double bend) {
  std::mt19937 random(99);
  const auto unit = [&] { return 2.0 * (static_cast<double>(random()) / 4294967296.0) - 1.0; };
  BundleProblem problem;
  problem.camera = scene.camera;
  problem.start = scene.truth;
  problem.start.point_in_world.clear();
  const double last = static_cast<double>(scene.truth.cam_from_world.size() - 1);
  for (auto& [frame, cam_from_world] : problem.start.cam_from_world) {
    if (frame.value == 0) continue;
    cam_from_world =
        Rotation::Exp(angle_deg * kRadFromDeg * Eigen::Vector3d(unit(), unit(), unit())) *
        cam_from_world;
    const double along = frame.value / last;
    problem.start.center_in_world[frame] += bend * (along * along * Eigen::Vector3d(1.0, 0.3, 0.0) +
                                                    0.05 * Eigen::Vector3d(unit(), unit(), unit()));
  }
  return problem;
}

/// Largest distance of centres after the best translation and scale (first centre onto first), over
/// the length of the path. Rotations of the world are for the caller to have fixed.
inline double CenterError(const Reconstruction& estimate, const Reconstruction& truth) {
  const Eigen::Vector3d a0 = estimate.center_in_world.begin()->second;
  const FrameId first = estimate.center_in_world.begin()->first;
  const Eigen::Vector3d b0 = truth.center_in_world.at(first);
  double ab = 0.0;
  double aa = 0.0;
  double largest = 0.0;
  double length = 0.0;
  for (const auto& [frame, center] : estimate.center_in_world) {
    ab += (center - a0).dot(truth.center_in_world.at(frame) - b0);
    aa += (center - a0).squaredNorm();
  }
  for (const auto& [frame, center] : estimate.center_in_world) {
    const Eigen::Vector3d b = truth.center_in_world.at(frame) - b0;
    largest = std::max(largest, (ab / aa * (center - a0) - b).norm());
    length = std::max(length, b.norm());
  }
  return largest / length;
}

inline double MaxRotationErrorDeg(const Reconstruction& estimate, const Reconstruction& truth) {
  double largest = 0.0;
  for (const auto& [frame, cam_from_world] : estimate.cam_from_world) {
    largest =
        std::max(largest, (cam_from_world * truth.cam_from_world.at(frame).Inverse()).AngleDeg());
  }
  return largest;
}

/// Options that go to the bottom of the cost.
inline BundleOptions ExactOptions() {
  BundleOptions options;
  options.fine.max_iterations = 200;
  options.fine.function_tolerance = 1e-15;
  return options;
}

}  // namespace rotslam
