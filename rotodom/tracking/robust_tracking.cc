#include "rotodom/tracking/robust_tracking.h"

#include <optional>
#include <utility>
#include <vector>

namespace rotslam {
namespace {

// Two measurements of one rotation, the rougher by unrefined corners, differ by less.
constexpr double kSameRotationDeg = 3.0;

// The most points of one view that agree on a relative rotation, and the target's orientation by
// it.
struct Agreement {
  int num_points = 0;  // 0 where fewer agree than chance could make
  Rotation cam_from_world;
};

Agreement AgreementOf(const TrackingResult& tracked,
                      std::span<const OrientedView> views,
                      const Camera& camera,
                      const RecoveryOptions& options) {
  Agreement most;
  for (int v = 0; v < static_cast<int>(views.size()); ++v) {
    std::vector<BearingPair> pairs;
    for (const TrackedPoint& point : tracked.points) {
      if (point.view != v) continue;
      if (const auto bearing = camera.Unproject(point.keypoint_px)) {
        pairs.push_back({views[v].view->features.bearings[point.index], *bearing});
      }
    }
    const auto estimate =
        EstimateRelativeRotation({pairs},
                                 tracked.cam_from_world * views[v].cam_from_world.Inverse(),
                                 camera.MeanFocal(),
                                 options.relative_rotation,
                                 options.seed);
    if (!estimate) continue;
    const int agreeing = static_cast<int>(estimate->inliers.size());
    const double ratio = static_cast<double>(agreeing) / static_cast<double>(pairs.size());
    if (ratio <= options.min_inlier_ratio || agreeing <= most.num_points) continue;
    most = {agreeing, estimate->j_from_i * views[v].cam_from_world};
  }
  return most;
}

}  // namespace

RobustTracking TrackOrRecover(std::span<const OrientedView> views,
                              const TrackingTarget& target,
                              const Camera& camera,
                              const RecoveryOptions& options) {
  TrackingResult tracked =
      TrackPoints(views, target, camera, options.tracking, options.num_threads);
  if (views.empty() || !tracked.IsPoor(options.tracking)) return {std::move(tracked), false};
  const auto recovery = RecoverMotion(views, target, camera, options);
  // Descriptors, searched everywhere, are another witness than patches, and a better one by the
  // places to which their matches were moved.
  const bool is_clear = recovery && recovery->is_clear;
  std::optional<Rotation> witness;
  if (is_clear) {
    const Agreement moved =
        AgreementOf({recovery->cam_from_world, recovery->points, 0}, views, camera, options);
    witness = moved.num_points > 0 ? moved.cam_from_world : recovery->cam_from_world;
  }
  TrackingResult best;
  best.cam_from_world = target.cam_from_world;
  int most_agreeing = 0;
  const auto consider = [&](TrackingResult&& candidate) {
    const Agreement agreement = AgreementOf(candidate, views, camera, options);
    if (agreement.num_points <= most_agreeing) return;
    const Rotation doubt = witness ? agreement.cam_from_world * witness->Inverse() : Rotation();
    if (doubt.AngleDeg() > kSameRotationDeg) return;
    most_agreeing = agreement.num_points;
    best = std::move(candidate);
  };
  // Without that witness, few of many points may have been found on anything.
  const bool is_plausible = static_cast<double>(tracked.points.size()) >=
                            options.tracking.min_found_ratio * tracked.num_sought;
  if (is_clear || is_plausible) consider(std::move(tracked));
  if (recovery) {
    TrackingTarget corrected = target;
    corrected.cam_from_world = recovery->guide_cam_from_world;
    corrected.flow = &recovery->flow;
    TrackingResult guided =
        TrackPoints(views, corrected, camera, options.tracking, options.num_threads);
    // With a wrong prediction few patches are found.
    if (is_clear || !guided.IsPoor(options.tracking)) consider(std::move(guided));
  }
  if (is_clear) consider({recovery->cam_from_world, recovery->points, 0});
  return {std::move(best), true};
}

}  // namespace rotslam
