#include "krot/initialisation/resection.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Dense>

#include "rotodom/types/splitmix64.h"
#include "rotodom/types/triangulation.h"

namespace rotslam {
namespace {

// Resection of a centre is triangulation of a point along the reversed rays from the known points.
Sighting Reversed(const RayToPoint& ray, double sigma) {
  return {Rotation(), ray.point_in_world, -ray.ray_in_world, sigma};
}

double RayError(const RayToPoint& ray, const Eigen::Vector3d& center) {
  const Eigen::Vector3d offset = ray.point_in_world - center;
  return std::atan2(offset.cross(ray.ray_in_world).norm(), offset.dot(ray.ray_in_world));
}

std::vector<int> Inliers(const std::vector<RayToPoint>& rays,
                         const Eigen::Vector3d& center,
                         double threshold) {
  std::vector<int> inliers;
  for (std::size_t k = 0; k < rays.size(); ++k) {
    if (RayError(rays[k], center) <= threshold) inliers.push_back(static_cast<int>(k));
  }
  return inliers;
}

// Point half-way between two lines; nullopt when they are parallel.
std::optional<Eigen::Vector3d> Midpoint(const RayToPoint& a, const RayToPoint& b) {
  const double cosine = a.ray_in_world.dot(b.ray_in_world);
  const double sine_squared = 1.0 - cosine * cosine;
  if (sine_squared < 1e-6) return std::nullopt;
  const Eigen::Vector3d w = b.point_in_world - a.point_in_world;
  const double along_a = w.dot(a.ray_in_world);
  const double along_b = w.dot(b.ray_in_world);
  const double s = (along_a - cosine * along_b) / sine_squared;
  const double t = (cosine * along_a - along_b) / sine_squared;
  return 0.5 * (a.point_in_world + s * a.ray_in_world + b.point_in_world + t * b.ray_in_world);
}

// Re-weighted least squares of angles.
std::optional<Eigen::Vector3d> Refine(const std::vector<RayToPoint>& rays,
                                      const std::vector<int>& inliers,
                                      Eigen::Vector3d center,
                                      double threshold) {
  const double scale = std::max(0.3 * threshold, 1e-12);
  for (int round = 0; round < 4; ++round) {
    std::vector<Sighting> sightings;
    for (const int k : inliers) {
      const double error = RayError(rays[k], center) / scale;
      sightings.push_back(Reversed(rays[k], std::sqrt(1.0 + error * error)));
    }
    const auto refined = Triangulate(sightings, 1e-6);
    if (!refined) return round == 0 ? std::nullopt : std::optional(center);
    center = *refined;
  }
  return center;
}

}  // namespace

std::optional<Resection> ResectCenter(const std::vector<RayToPoint>& rays,
                                      const CenterResectionOptions& options) {
  const int count = static_cast<int>(rays.size());
  if (count < 3) return std::nullopt;
  SplitMix64 random(options.seed);
  std::vector<int> best;
  Eigen::Vector3d best_center = Eigen::Vector3d::Zero();
  int needed = options.max_samples;
  for (int sample = 0; sample < needed; ++sample) {
    const int a = random.Index(count);
    const int b = random.Index(count);
    if (a == b) continue;
    const auto center = Midpoint(rays[a], rays[b]);
    if (!center) continue;
    std::vector<int> inliers = Inliers(rays, *center, options.threshold_rad);
    if (inliers.size() <= best.size()) continue;
    best = std::move(inliers);
    best_center = *center;
    // Number of samples that contain a pair of inliers with probability 1 - 1e-6.
    const double share = static_cast<double>(best.size()) / count;
    const double miss = std::log(std::max(1e-12, 1.0 - share * share));
    needed = std::min(options.max_samples, std::max(20, static_cast<int>(-13.8 / miss) + 1));
  }
  if (best.size() < 3) return std::nullopt;
  for (int round = 0; round < 2; ++round) {
    const auto refined = Refine(rays, best, best_center, options.threshold_rad);
    if (!refined) return std::nullopt;
    std::vector<int> inliers = Inliers(rays, *refined, options.threshold_rad);
    if (inliers.size() < best.size() / 2 || inliers.size() < 3) break;
    best_center = *refined;
    best = std::move(inliers);
  }
  return Resection{best_center, best};
}

}  // namespace rotslam
