#include "krot/initialisation/two_view_translation.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/Dense>

#include "rotodom/types/draw.h"

namespace rotslam {
namespace {

// What divides |normal . direction| to give the angle by which the rays miss a common plane with
// `direction`: the larger of two ways to measure it, so that a ray near the epipole does not blow
// the angle up.
double Reach(const RayPair& pair, const Eigen::Vector3d& direction) {
  const double sine = std::max(direction.cross(pair.ray_a_in_world).norm(),
                               direction.cross(pair.ray_b_in_world).norm());
  return std::max(sine, 1e-12);
}

std::vector<int> Inliers(const std::vector<RayPair>& pairs,
                         const std::vector<Eigen::Vector3d>& normals,
                         const Eigen::Vector3d& direction,
                         double threshold) {
  std::vector<int> inliers;
  for (int k = 0; k < static_cast<int>(pairs.size()); ++k) {
    const double error = std::abs(normals[k].dot(direction)) / Reach(pairs[k], direction);
    if (error <= threshold) inliers.push_back(k);
  }
  return inliers;
}

// Direction with the least sum of squared angles over the inliers, starting from one.
Eigen::Vector3d Refine(const std::vector<RayPair>& pairs,
                       const std::vector<Eigen::Vector3d>& normals,
                       const std::vector<int>& inliers,
                       Eigen::Vector3d direction) {
  constexpr int kMaxSteps = 5;
  for (int step = 0; step < kMaxSteps; ++step) {
    Eigen::Matrix3d M = Eigen::Matrix3d::Zero();
    for (const int k : inliers) {
      const Eigen::Vector3d scaled = normals[k] / Reach(pairs[k], direction);
      M += scaled * scaled.transpose();
    }
    direction = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(M).eigenvectors().col(0);
  }
  return direction;
}

// Where the inliers with parallax lie, of both views.
struct Sides {
  int front = 0;
  int behind = 0;
  int with_parallax = 0;
};

Sides CountSides(const std::vector<RayPair>& pairs,
                 const std::vector<Eigen::Vector3d>& normals,
                 const std::vector<int>& inliers,
                 const Eigen::Vector3d& direction,
                 double min_parallax) {
  Sides sides;
  for (const int k : inliers) {
    if (normals[k].norm() < std::sin(min_parallax)) continue;
    ++sides.with_parallax;
    // lambda ray_a = direction + mu ray_b, each side crossed with the other ray.
    const double lambda = direction.cross(pairs[k].ray_b_in_world).dot(normals[k]);
    const double mu = direction.cross(pairs[k].ray_a_in_world).dot(normals[k]);
    sides.front += lambda > 0.0 && mu > 0.0;
    sides.behind += lambda < 0.0 && mu < 0.0;
  }
  return sides;
}

}  // namespace

std::optional<TwoViewTranslation> EstimateTwoViewTranslation(
    const std::vector<RayPair>& pairs, const TwoViewTranslationOptions& options) {
  if (pairs.size() < 2) return std::nullopt;
  std::vector<Eigen::Vector3d> normals;
  normals.reserve(pairs.size());
  for (const RayPair& pair : pairs) {
    normals.push_back(pair.ray_a_in_world.cross(pair.ray_b_in_world));
  }
  Draw draw(options.seed);
  const int count = static_cast<int>(pairs.size());
  TwoViewTranslation best;
  for (int sample = 0; sample < options.max_samples; ++sample) {
    const int first = draw.Index(count);
    const int second = draw.Index(count);
    const Eigen::Vector3d direction = normals[first].cross(normals[second]);
    if (!(direction.norm() > 1e-12)) continue;
    std::vector<int> inliers =
        Inliers(pairs, normals, direction.normalized(), options.threshold_rad);
    if (inliers.size() <= best.inliers.size()) continue;
    best.direction_in_world = direction.normalized();
    best.inliers = std::move(inliers);
  }
  if (static_cast<int>(best.inliers.size()) < options.min_inliers) return std::nullopt;
  best.direction_in_world = Refine(pairs, normals, best.inliers, best.direction_in_world);
  best.inliers = Inliers(pairs, normals, best.direction_in_world, options.threshold_rad);
  if (static_cast<int>(best.inliers.size()) < options.min_inliers) return std::nullopt;

  Sides sides =
      CountSides(pairs, normals, best.inliers, best.direction_in_world, options.threshold_rad);
  if (sides.behind > sides.front) {
    best.direction_in_world = -best.direction_in_world;
    std::swap(sides.front, sides.behind);
  }
  if (sides.front == sides.behind) return std::nullopt;
  best.front_ratio = static_cast<double>(sides.front) / sides.with_parallax;
  return best;
}

}  // namespace rotslam
