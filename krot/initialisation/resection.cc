#include "krot/initialisation/resection.h"

#include <algorithm>
#include <cmath>

#include "krot/initialisation/robust_triangulation.h"
#include "rotodom/types/splitmix64.h"

namespace rotslam {
namespace {

// Point half-way between two lines; nullopt when they are parallel.
std::optional<Eigen::Vector3d> Midpoint(const PosedRay& a, const PosedRay& b) {
  const Eigen::Vector3d along_a = a.cam_from_world.Inverse() * a.bearing;
  const Eigen::Vector3d along_b = b.cam_from_world.Inverse() * b.bearing;
  const double cosine = along_a.dot(along_b);
  const double sine_squared = 1.0 - cosine * cosine;
  if (sine_squared < 1e-6) return std::nullopt;
  const Eigen::Vector3d w = b.center_in_world - a.center_in_world;
  const double s = (w.dot(along_a) - cosine * w.dot(along_b)) / sine_squared;
  const double t = (cosine * w.dot(along_a) - w.dot(along_b)) / sine_squared;
  return 0.5 * (a.center_in_world + s * along_a + b.center_in_world + t * along_b);
}

// Re-weighted least squares of angles.
std::optional<Eigen::Vector3d> Refine(const std::vector<PosedRay>& rays,
                                      const std::vector<int>& inliers,
                                      Eigen::Vector3d center,
                                      double threshold) {
  const double scale = std::max(0.3 * threshold, 1e-12);
  for (int round = 0; round < 4; ++round) {
    std::vector<PosedRay> weighted;
    for (const int k : inliers) {
      const double error = BearingError(rays[k], center) / scale;
      weighted.push_back(rays[k]);
      weighted.back().sigma = std::sqrt(1.0 + error * error);
    }
    const auto refined = Triangulate(weighted, 1e-6);
    if (!refined) return round == 0 ? std::nullopt : std::optional(center);
    center = *refined;
  }
  return center;
}

}  // namespace

std::optional<Resection> ResectCenter(const std::vector<PosedRay>& rays,
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
    std::vector<int> inliers = InliersOf(rays, *center, options.threshold_rad);
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
    std::vector<int> inliers = InliersOf(rays, *refined, options.threshold_rad);
    if (inliers.size() < best.size() / 2 || inliers.size() < 3) break;
    best_center = *refined;
    best = std::move(inliers);
  }
  return Resection{best_center, best};
}

}  // namespace rotslam
