#include "krot/initialisation/robust_triangulation.h"

#include "rotodom/types/splitmix64.h"

namespace rotslam {
namespace {

std::vector<PosedRay> Pick(const std::vector<PosedRay>& rays, const std::vector<int>& chosen) {
  std::vector<PosedRay> picked;
  picked.reserve(chosen.size());
  for (const int k : chosen) picked.push_back(rays[k]);
  return picked;
}

}  // namespace

std::vector<int> InliersOf(const std::vector<PosedRay>& rays,
                           const Eigen::Vector3d& point,
                           double threshold_rad) {
  std::vector<int> inliers;
  for (std::size_t k = 0; k < rays.size(); ++k) {
    if (BearingError(rays[k], point) <= threshold_rad) inliers.push_back(static_cast<int>(k));
  }
  return inliers;
}

std::optional<RobustPoint> TriangulateRobustly(const std::vector<PosedRay>& rays,
                                               double min_angle_rad,
                                               double threshold_rad) {
  const int count = static_cast<int>(rays.size());
  if (count < 2) return std::nullopt;
  if (const auto point = Triangulate(rays, min_angle_rad)) {
    std::vector<int> inliers = InliersOf(rays, *point, threshold_rad);
    if (static_cast<int>(inliers.size()) == count) return RobustPoint{*point, std::move(inliers)};
  }
  if (count < 3) return std::nullopt;
  std::vector<int> best;
  const auto propose = [&](int a, int b) {
    const auto point = Triangulate({rays[a], rays[b]}, 0.5 * min_angle_rad);
    if (!point) return;
    std::vector<int> inliers = InliersOf(rays, *point, threshold_rad);
    if (inliers.size() > best.size()) best = std::move(inliers);
  };
  propose(0, count - 1);
  propose(0, count / 2);
  propose(count / 2, count - 1);
  // All pairs of a short track, fifteen pairs of a long one.
  if (count <= 6) {
    for (int a = 0; a < count; ++a) {
      for (int b = a + 1; b < count; ++b) propose(a, b);
    }
  } else {
    SplitMix64 random(static_cast<std::uint64_t>(count));
    for (int trial = 0; trial < 15; ++trial) {
      const int a = random.Index(count);
      const int b = random.Index(count);
      if (a != b) propose(a, b);
    }
  }
  if (2 * static_cast<int>(best.size()) <= count || best.size() < 2) return std::nullopt;
  const auto refitted = Triangulate(Pick(rays, best), min_angle_rad);
  if (!refitted) return std::nullopt;
  best = InliersOf(rays, *refitted, threshold_rad);
  if (2 * static_cast<int>(best.size()) <= count || best.size() < 2) return std::nullopt;
  const std::vector<PosedRay> kept = Pick(rays, best);
  if (TriangulationAngle(kept, *refitted) < min_angle_rad) return std::nullopt;
  return RobustPoint{*refitted, std::move(best)};
}

}  // namespace rotslam
