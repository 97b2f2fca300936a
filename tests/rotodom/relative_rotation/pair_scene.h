#pragma once

#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include "rotodom/relative_rotation/relative_rotation.h"

namespace rotslam {

/// Two views of random points, with truth.
struct PairSceneOptions {
  int num_pairs = 500;
  double baseline_over_depth = 0.1;
  double noise_px = 0.5;
  double outlier_ratio = 0.0;
  // Longest over shortest axis of the noise of a position in view j. Other than one: the axes point
  // anywhere, have the mean variance 2 noise_px^2, view i is exact, and every pair knows its noise.
  double noise_ratio = 1.0;
  double rotation_deg = 3.0;
  // All points lie on a plane across the view, and the baseline is parallel to it.
  bool plane = false;
  std::uint64_t seed = 1;
};

struct PairScene {
  std::vector<BearingPair> pairs;
  Rotation j_from_i;
  Eigen::Vector3d translation_direction;
};

constexpr double kPairFocalPx = 700.0;

inline PairScene MakePairScene(const PairSceneOptions& options) {
  std::mt19937_64 random(options.seed);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  std::normal_distribution<double> normal;
  const auto random_direction = [&] {
    return Eigen::Vector3d(normal(random), normal(random), normal(random)).normalized();
  };
  const double sigma = options.noise_px / kPairFocalPx;
  const auto exact = [](const Eigen::Vector3d& point) {
    return Eigen::Vector3d(Eigen::Vector3d(point / point.z()).normalized());
  };
  const auto noisy = [&](const Eigen::Vector3d& point) {
    const Eigen::Vector3d image(point.x() / point.z() + sigma * normal(random),
                                point.y() / point.z() + sigma * normal(random),
                                1.0);
    return Eigen::Vector3d(image.normalized());
  };
  const auto followed = [&](const Eigen::Vector3d& point_i, const Eigen::Vector3d& point_j) {
    const double angle = 3.14159265358979 * uniform(random);
    const Eigen::Vector2d axis(std::cos(angle), std::sin(angle));
    const double squared_ratio = options.noise_ratio * options.noise_ratio;
    const double across = 4.0 / (1.0 + squared_ratio);
    const Eigen::Matrix2d covariance = across * Eigen::Matrix2d::Identity() +
                                       (squared_ratio - 1.0) * across * axis * axis.transpose();
    const Eigen::Vector2d along_axis = axis * std::sqrt(squared_ratio * across) * normal(random);
    const Eigen::Vector2d offset = sigma * (along_axis + Eigen::Vector2d(-axis.y(), axis.x()) *
                                                             std::sqrt(across) * normal(random));
    const Eigen::Vector3d moved =
        point_j / point_j.z() + Eigen::Vector3d(offset.x(), offset.y(), 0.0);
    const Eigen::Vector3d bearing_j = moved.normalized();
    return BearingPair{
        exact(point_i), bearing_j, MatchNoise{TangentCovariance(bearing_j, covariance), 0.0}};
  };
  PairScene scene;
  scene.j_from_i = Rotation::Exp(options.rotation_deg * kRadFromDeg * random_direction());
  scene.translation_direction = random_direction();
  if (options.plane) {
    const Eigen::Vector3d across = scene.j_from_i * Eigen::Vector3d::UnitZ();
    scene.translation_direction = scene.translation_direction.cross(across).normalized();
  }
  const double mean_depth = 10.0;
  const Eigen::Vector3d translation =
      options.baseline_over_depth * mean_depth * scene.translation_direction;
  while (static_cast<int>(scene.pairs.size()) < options.num_pairs) {
    // 640 x 480 at the focal length above; depths 5 to 15.
    const double depth = options.plane ? mean_depth : mean_depth + 5.0 * uniform(random);
    const Eigen::Vector3d point_i(
        0.457 * uniform(random) * depth, 0.343 * uniform(random) * depth, depth);
    const Eigen::Vector3d point_j = scene.j_from_i * point_i + translation;
    if (point_j.z() < 1.0) continue;
    BearingPair pair = options.noise_ratio == 1.0 ? BearingPair{noisy(point_i), noisy(point_j)}
                                                  : followed(point_i, point_j);
    if (0.5 * (uniform(random) + 1.0) < options.outlier_ratio) {
      pair.bearing_j =
          Eigen::Vector3d(0.457 * uniform(random), 0.343 * uniform(random), 1.0).normalized();
    }
    scene.pairs.push_back(pair);
  }
  return scene;
}

}  // namespace rotslam
