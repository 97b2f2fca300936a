#include "rotodom/types/trajectory.h"

#include <algorithm>
#include <cmath>
#include <iterator>

namespace rotslam {

std::optional<StampedPose> PoseAt(const Trajectory& trajectory,
                                  double timestamp_s,
                                  double exact_s,
                                  double max_gap_s) {
  if (trajectory.size() < 2) return std::nullopt;
  const auto upper = std::lower_bound(
      trajectory.begin(),
      trajectory.end(),
      timestamp_s,
      [](const StampedPose& pose, double time_s) { return pose.timestamp_s < time_s; });
  // The two poses around the time, or the two nearest the end that it lies beyond.
  const auto after = std::clamp(upper, std::next(trajectory.begin()), std::prev(trajectory.end()));
  const StampedPose& a = *std::prev(after);
  const StampedPose& b = *after;
  const double gap_s = b.timestamp_s - a.timestamp_s;
  const bool is_exact = std::min(std::abs(a.timestamp_s - timestamp_s),
                                 std::abs(b.timestamp_s - timestamp_s)) < exact_s;
  const bool is_inside =
      a.timestamp_s <= timestamp_s && timestamp_s <= b.timestamp_s && gap_s <= max_gap_s;
  if (!is_exact && !is_inside) return std::nullopt;
  const double weight =
      std::clamp((timestamp_s - a.timestamp_s) / std::max(gap_s, 1e-12), 0.0, 1.0);
  return StampedPose{timestamp_s,
                     Interpolate(a.world_from_cam, b.world_from_cam, weight),
                     (1.0 - weight) * a.center_in_world + weight * b.center_in_world};
}

}  // namespace rotslam
