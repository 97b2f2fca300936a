#include "rotodom/tracking/recovery.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "rotodom/matching/patch_alignment.h"

namespace rotslam {
namespace {

// Refines the position of a matched corner of `target` by aligning the patch of a view; unchanged
// where that fails.
PatchAlignment SharpenedPosition(const std::optional<PatchTemplate>& patch,
                                 const cv::Mat& target,
                                 const Eigen::Vector2d& corner_px,
                                 double min_correlation) {
  constexpr double kReachPx = 3.0;  // more than corners on coarse levels are off by
  PatchAlignment corner{corner_px, 0.0, Eigen::Matrix2d::Identity()};
  if (!patch) return corner;
  const auto found = AlignPatch(*patch, target, corner_px, kReachPx);
  return found && found->correlation >= min_correlation ? *found : corner;
}

// Matches the points of one view with the described corners of the target. The points found name no
// view.
std::optional<Recovery> RecoverFrom(const OrientedView& oriented,
                                    const Features& corners,
                                    const TrackingTarget& target,
                                    const Camera& camera,
                                    const RecoveryOptions& options) {
  const View& view = *oriented.view;
  Features described = view.features;
  DescribeFeatures(view.pyramid, options.num_threads, described);
  const Rotation predicted = target.cam_from_world * oriented.cam_from_world.Inverse();
  const Matches matches = MatchFeatures(described, corners, predicted, camera, options.matching);
  std::vector<BearingPair> pairs;
  for (const Match& match : matches.matches) {
    pairs.push_back({described.bearings[match.i.value], corners.bearings[match.j.value]});
  }
  const auto estimate = EstimateRelativeRotation(
      {pairs}, predicted, camera.MeanFocal(), options.relative_rotation, options.seed);
  if (!estimate) return std::nullopt;
  std::vector<BearingPair> agreeing;
  for (const int inlier : estimate->inliers) agreeing.push_back(pairs[inlier]);
  // For the prediction the rotation alone is used, which cannot confuse rotation and translation.
  const Rotation target_from_view = AlignMostBearings(agreeing).value_or(estimate->j_from_i);

  const cv::Mat& image = target.pyramid->levels.front();
  Recovery recovery{target_from_view * oriented.cam_from_world,
                    FlowField(image.cols, image.rows),
                    estimate->j_from_i * oriented.cam_from_world,
                    {},
                    matches.range};
  for (const int inlier : estimate->inliers) {
    const int index = matches.matches[inlier].i.value;
    const Eigen::Vector2d& corner_px = corners.keypoints_px[matches.matches[inlier].j.value];
    const auto patch =
        PatchTemplate::Sample(view.pyramid.levels.front(),
                              view.features.keypoints_px[index],
                              PatchWarp(camera, described.bearings[index], target_from_view));
    const PatchAlignment found =
        SharpenedPosition(patch, image, corner_px, options.tracking.min_correlation);
    const auto turned_px = camera.Project(target_from_view * described.bearings[index]);
    if (turned_px) {
      recovery.flow.Add(described.keypoints_px[index],
                        (found.center_px - *turned_px) / (target.timestamp_s - view.timestamp_s));
    }
    if (view.is_lost[index]) continue;
    recovery.points.push_back(
        {described.tracks[index], 0, index, found.center_px, found.covariance});
  }
  std::sort(recovery.points.begin(), recovery.points.end(), [](const auto& a, const auto& b) {
    return a.track < b.track;
  });
  const double least = options.min_inlier_ratio * static_cast<double>(pairs.size());
  recovery.is_clear = static_cast<double>(estimate->inliers.size()) > least;
  return recovery;
}

// The best recovery: clear ones first, then by number of points.
std::optional<Recovery> Clearest(std::vector<Recovery>& recoveries) {
  const auto best = std::max_element(
      recoveries.begin(), recoveries.end(), [](const Recovery& a, const Recovery& b) {
        return std::pair(a.is_clear, a.points.size()) < std::pair(b.is_clear, b.points.size());
      });
  if (best == recoveries.end()) return std::nullopt;
  return std::move(*best);
}

}  // namespace

std::optional<Recovery> RecoverMotion(std::span<const OrientedView> views,
                                      const TrackingTarget& target,
                                      const Camera& camera,
                                      const RecoveryOptions& options) {
  Features corners;
  DetectFeatures(*target.pyramid, camera, options.features, options.num_threads, corners);
  DescribeFeatures(*target.pyramid, options.num_threads, corners);
  std::vector<Recovery> recoveries;
  for (int v = 0; v < static_cast<int>(views.size()); ++v) {
    std::optional<Recovery> recovery = RecoverFrom(views[v], corners, target, camera, options);
    if (!recovery) continue;
    for (TrackedPoint& point : recovery->points) point.view = v;
    if (static_cast<int>(recovery->points.size()) >= options.tracking.min_points) {
      recovery->is_clear = true;
      return recovery;
    }
    // Few points may agree by chance, so older views are tried as well.
    recoveries.push_back(*std::move(recovery));
  }
  return Clearest(recoveries);
}

}  // namespace rotslam
