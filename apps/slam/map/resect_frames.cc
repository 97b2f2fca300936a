#include "apps/slam/map/resect_frames.h"

#include <iterator>
#include <optional>

#include "rotodom/types/parallel.h"

namespace rotslam {
namespace {

// Calls `find_pose(observations, start)` for each frame.
template <class FindPose>
std::map<FrameId, ResectedPose> ForEachFrame(const std::map<FrameId, ResectionStart>& starts,
                                             const SeenMap& map,
                                             int num_threads,
                                             const FindPose& find_pose) {
  struct SeenFrame {
    FrameId id;
    const ResectionStart* start;
    std::vector<PointObservation2D3D> observations;
    std::optional<ResectedPose> pose;
  };
  std::vector<SeenFrame> frames;
  std::map<FrameId, int> place;
  for (const auto& [frame, start] : starts) {
    place[frame] = static_cast<int>(frames.size());
    frames.push_back({frame, &start, {}, std::nullopt});
  }
  for (const Track& track : map.tracks) {
    const auto point = map.points.find(track.id);
    if (point == map.points.end()) continue;
    for (const Observation& observation : track.observations) {
      const auto seen_from = place.find(observation.frame);
      if (seen_from == place.end()) continue;
      frames[seen_from->second].observations.push_back({track.id,
                                                        point->second,
                                                        observation.keypoint_px,
                                                        observation.sigma_px,
                                                        observation.blur});
    }
  }
  ParallelFor(static_cast<int>(frames.size()), num_threads, [&](int k) {
    frames[k].pose = find_pose(frames[k].observations, *frames[k].start);
  });
  std::map<FrameId, ResectedPose> poses;
  for (const SeenFrame& frame : frames) {
    if (frame.pose) poses[frame.id] = *frame.pose;
  }
  return poses;
}

}  // namespace

Eigen::Vector3d InterpolatedCenter(const CenterMap& centers,
                                   const std::vector<double>& timestamps_s,
                                   FrameId frame) {
  const auto after = centers.lower_bound(frame);
  if (after == centers.end()) return centers.rbegin()->second;
  if (after->first == frame || after == centers.begin()) return after->second;
  const auto before = std::prev(after);
  const double from_s = timestamps_s[before->first.value];
  const double to_s = timestamps_s[after->first.value];
  const double weight = (timestamps_s[frame.value] - from_s) / (to_s - from_s);
  return (1.0 - weight) * before->second + weight * after->second;
}

std::map<FrameId, ResectedPose> ResectFrames(const std::map<FrameId, ResectionStart>& starts,
                                             const SeenMap& map,
                                             const Camera& camera,
                                             const ResectionOptions& options,
                                             int num_threads) {
  return ForEachFrame(starts, map, num_threads, [&](const auto& observations, const auto& start) {
    return ResectFrame(camera, observations, start, options);
  });
}

std::map<FrameId, ResectedPose> AssessFrames(const std::map<FrameId, ResectionStart>& poses,
                                             const SeenMap& map,
                                             const Camera& camera,
                                             const ResectionOptions& options,
                                             int num_threads) {
  return ForEachFrame(poses, map, num_threads, [&](const auto& observations, const auto& start) {
    return AssessPose(camera, observations, start, options);
  });
}

}  // namespace rotslam
