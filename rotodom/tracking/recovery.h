#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "rotodom/matching/matching.h"
#include "rotodom/relative_rotation/relative_rotation.h"
#include "rotodom/tracking/tracking.h"

namespace rotslam {

/// Motion of the camera found by matching descriptors, without a reliable prediction.
struct Recovery {
  Rotation guide_cam_from_world;     // best alignment of the matches by a rotation alone
  FlowField flow;                    // image motion that this rotation leaves
  Rotation cam_from_world;           // from the epipolar constraint
  std::vector<TrackedPoint> points;  // those matched, ascending in `track`
  SearchRange range = SearchRange::kGuided;
  // Enough of the matches agree. If not, agreement may be by chance, and the motion serves only as
  // a prediction for tracking.
  bool is_clear = false;
};

/// Options of RecoverMotion.
struct RecoveryOptions {
  FeatureOptions features;
  MatchingOptions matching;
  RelativeRotationOptions relative_rotation;
  TrackingOptions tracking;
  double min_inlier_ratio = 0.5;  // as in ViewGraphOptions, of the descriptor matches
  std::uint64_t seed = 1;
  int num_threads = 1;
};

/// Recovers from lost tracking: matches the target's ORB features against those of `views`, one
/// view after the other, until tracking.min_points matches agree on a relative rotation, and takes
/// the view with the most. Where fewer agree, a view with a share of agreeing matches above
/// min_inlier_ratio takes precedence. The others serve as a prediction only, since four in ten
/// matches may agree on a rotation that is wrong by ten degrees.
/// @param views  newest first.
/// @return  nullopt when no view matches.
std::optional<Recovery> RecoverMotion(std::span<const OrientedView> views,
                                      const TrackingTarget& target,
                                      const Camera& camera,
                                      const RecoveryOptions& options);

}  // namespace rotslam
