#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "rotodom/matching/matching.h"
#include "rotodom/relative_rotation/relative_rotation.h"
#include "rotodom/tracking/tracking.h"

namespace rotslam {

/// How the camera moved, found without a prediction to rely on.
struct Recovery {
  Rotation guide_cam_from_world;     // aligns the matches best, as if nothing had moved
  FlowField flow;                    // what that leaves
  Rotation cam_from_world;           // by the epipolar constraint
  std::vector<TrackedPoint> points;  // those matched, ascending in `track`
  SearchRange range = SearchRange::kGuided;
  // Enough of what looks alike agrees. If not, it may be by chance: only a guide to where patches
  // are to be sought.
  bool is_clear = false;
};

/// Of finding features again that tracking has lost.
struct RecoveryOptions {
  FeatureOptions features;
  MatchingOptions matching;
  RelativeRotationOptions relative_rotation;
  TrackingOptions tracking;
  double min_inlier_ratio = 0.5;  // of what looks alike
  std::uint64_t seed = 1;
  int num_threads = 1;
};

/// Matches the target's ORB features against those of `views`, one view after the other, until
/// tracking.min_points matches agree on a relative rotation, and takes the view with the most: the
/// way back when tracking has failed. Where fewer agree, a view of which more than min_inlier_ratio
/// of what looks alike do goes before others, which are no more than a guide: after a gap of
/// seconds, four in ten of a hundred matches agreed on rotations that were 7 to 10 deg off.
/// @param views  newest first.
/// @return  nullopt when no view matches.
std::optional<Recovery> RecoverMotion(std::span<const OrientedView> views,
                                      const TrackingTarget& target,
                                      const Camera& camera,
                                      const RecoveryOptions& options);

}  // namespace rotslam
