#include "rotodom/motion_blur/exposure.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <vector>

#include <Eigen/Dense>

#include "rotodom/matching/patch_alignment.h"
#include "rotodom/motion_blur/blurred_patch.h"
#include "rotodom/motion_blur/keypoint_blur.h"
#include "rotodom/types/parallel.h"

namespace rotslam {
namespace {

constexpr double kBetweenCandidates_s = 0.0025;  // step of the exposure times, up to 40 ms
constexpr int kMostPatches = 32;                 // per pair of views, bounds the time
constexpr int kFewestPatches = 12;               // for a mean that single patches do not dominate
// Largest distance of a patch from its tracked position, px.
constexpr double kPatchReachPx = 3.0;
// Factor on the weight of older pairs for each new pair.
constexpr double kMemory = 0.95;
// Smallest gain over exchanged blur vectors that is significant, nats per patch: sharp images reach
// 0.2, 3 px of blur 0.5 to 1.
constexpr double kLeastGain = 0.4;
// Smallest difference of the image speeds: 2 px of blur within 20 ms.
constexpr double kSlowestDifference_px_per_s = 100.0;

// One point in two images, with its speed in each.
struct MovingPoint {
  int index_i;
  int index_j;
  Eigen::Vector2d velocity_i;
  Eigen::Vector2d velocity_j;
};

std::vector<MovingPoint> CommonPoints(const Camera& camera,
                                      const RotatingView& i,
                                      const RotatingView& j) {
  const View& view_i = *i.oriented.view;
  const View& view_j = *j.oriented.view;
  std::vector<std::array<int, 2>> common;
  for (int index_j = 0; index_j < view_j.features.size(); ++index_j) {
    const int index_i = FindTrack(view_i.features, view_j.features.tracks[index_j]);
    if (index_i < 0 || view_i.is_lost[index_i] || view_j.is_lost[index_j]) continue;
    common.push_back({index_i, index_j});
  }
  const std::size_t step = std::max<std::size_t>(1, common.size() / kMostPatches);
  std::vector<MovingPoint> points;
  for (std::size_t k = 0; k < common.size(); k += step) {
    const auto& [index_i, index_j] = common[k];
    points.push_back({index_i,
                      index_j,
                      BlurVectorOf(camera, view_i.features.bearings[index_i], i.rate, 1.0),
                      BlurVectorOf(camera, view_j.features.bearings[index_j], j.rate, 1.0)});
  }
  return points;
}

// Adds the mean over the points to the weighted sum over earlier pairs.
template <class Dissimilarity>
void AddToSum(const std::vector<Dissimilarity>& of_points, Dissimilarity& weighted_sum) {
  for (std::size_t candidate = 0; candidate < weighted_sum.size(); ++candidate) {
    double sum = 0.0;
    for (const Dissimilarity& of_point : of_points) sum += of_point[candidate];
    weighted_sum[candidate] =
        kMemory * weighted_sum[candidate] + sum / static_cast<double>(of_points.size());
  }
}

}  // namespace

bool ExposureMeter::IsInformative(const Eigen::Vector3d& rate_i,
                                  const Eigen::Vector3d& rate_j,
                                  double focal_px) {
  const double slow = std::min(rate_i.norm(), rate_j.norm());
  const double fast = std::max(rate_i.norm(), rate_j.norm());
  return 2.0 * slow <= fast && (fast - slow) * focal_px >= kSlowestDifference_px_per_s;
}

void ExposureMeter::Add(const Camera& camera,
                        const RotatingView& i,
                        const RotatingView& j,
                        int num_threads) {
  const std::vector<MovingPoint> points = CommonPoints(camera, i, j);
  if (points.size() < kFewestPatches) return;
  const View& view_i = *i.oriented.view;
  const View& view_j = *j.oriented.view;
  const Rotation j_from_i = j.oriented.cam_from_world * i.oriented.cam_from_world.Inverse();
  std::vector<Dissimilarity> of_points(points.size());
  std::vector<Dissimilarity> reversed(points.size());
  ParallelFor(static_cast<int>(points.size()), num_threads, [&](int k) {
    const MovingPoint& point = points[k];
    const Eigen::Matrix2d j_from_i_px =
        PatchWarp(camera, view_i.features.bearings[point.index_i], j_from_i);
    const Eigen::Matrix2d i_from_j_px = j_from_i_px.inverse();
    const auto dissimilarity = [&](const Eigen::Vector2d& blur_i, const Eigen::Vector2d& blur_j) {
      const BlurredPatch patch{view_i.pyramid.levels.front(),
                               view_i.features.keypoints_px[point.index_i],
                               j_from_i_px,
                               blur_i};
      const auto found = AlignBlurredPatch(patch,
                                           view_j.pyramid.levels.front(),
                                           view_j.features.keypoints_px[point.index_j],
                                           blur_j,
                                           kPatchReachPx);
      // A patch that is not found has correlation zero; the upper bound keeps the logarithm finite
      // for exact patches of renderings.
      const double correlation = found ? std::clamp(found->correlation, 0.0, 0.9999) : 0.0;
      return std::log(1.0 - correlation * correlation);
    };
    for (int candidate = 0; candidate < kNumCandidates; ++candidate) {
      const double exposure_s = candidate * kBetweenCandidates_s;
      const Eigen::Vector2d blur_i = exposure_s * point.velocity_i;
      const Eigen::Vector2d blur_j = exposure_s * point.velocity_j;
      of_points[k][candidate] = dissimilarity(blur_i, blur_j);
      reversed[k][candidate] = dissimilarity(i_from_j_px * blur_j, j_from_i_px * blur_i);
    }
  });
  weight_ = kMemory * weight_ + 1.0;
  AddToSum(of_points, dissimilarity_);
  AddToSum(reversed, dissimilarity_reversed_);
}

double ExposureMeter::Seconds() const {
  const auto best = std::min_element(dissimilarity_.begin(), dissimilarity_.end());
  const auto index = best - dissimilarity_.begin();
  if (index == 0 || dissimilarity_reversed_[index] - *best < kLeastGain * weight_) return 0.0;
  double candidate = static_cast<double>(index);
  // Minimum of the parabola through the best candidate and its neighbours.
  if (std::next(best) != dissimilarity_.end()) {
    const double before = *std::prev(best);
    const double after = *std::next(best);
    const double bend = before - 2.0 * *best + after;
    if (bend > 0.0) candidate += 0.5 * (before - after) / bend;
  }
  return candidate * kBetweenCandidates_s;
}

}  // namespace rotslam
