#include "apps/slam/frame_registration.h"

#include <algorithm>
#include <iterator>
#include <map>
#include <optional>
#include <set>

#include "rotodom/averaging/anchors.h"
#include "rotodom/types/parallel.h"

namespace rotslam {
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
                                             const PointMap& points,
                                             const std::vector<Track>& tracks,
                                             const Camera& camera,
                                             const ResectionOptions& options,
                                             int num_threads) {
  struct SeenFrame {
    FrameId id;
    const ResectionStart* start;
    std::vector<PointSighting> sightings;
    std::optional<ResectedPose> pose;
  };
  std::vector<SeenFrame> frames;
  std::map<FrameId, int> place;
  for (const auto& [frame, start] : starts) {
    place[frame] = static_cast<int>(frames.size());
    frames.push_back({frame, &start, {}, std::nullopt});
  }
  for (const Track& track : tracks) {
    const auto point = points.find(track.id);
    if (point == points.end()) continue;
    for (const Observation& observation : track.observations) {
      const auto seen_from = place.find(observation.frame);
      if (seen_from == place.end()) continue;
      frames[seen_from->second].sightings.push_back(
          {point->second, observation.keypoint_px, observation.sigma_px, observation.blur});
    }
  }
  ParallelFor(static_cast<int>(frames.size()), num_threads, [&](int k) {
    frames[k].pose = ResectFrame(camera, frames[k].sightings, *frames[k].start, options);
  });
  std::map<FrameId, ResectedPose> poses;
  for (const SeenFrame& frame : frames) {
    if (frame.pose) poses[frame.id] = *frame.pose;
  }
  return poses;
}

void RegisterFrames(const Orientations& orientations,
                    const std::vector<Track>& all_tracks,
                    const PipelineOptions& options,
                    int num_threads,
                    PositionResult& result) {
  const CenterMap anchors = result.map.center_in_world;
  std::set<FrameId> refined;
  for (const auto& [frame, rotation] : result.map.cam_from_world) refined.insert(frame);
  const std::map<FrameId, Eigen::Matrix3d> rotation_covariance = AnchorCovariances(
      orientations.graph, result.cam_from_world, refined, options.rotodom.averaging);
  const std::vector<double>& timestamps_s = orientations.timestamps_s;
  result.center_in_world = anchors;
  std::vector<FrameId> remaining;
  for (const auto& [frame, rotation] : result.cam_from_world) {
    if (anchors.contains(frame)) continue;
    // Inside a segment the place is that of its ends, to the last bit.
    const PureRotationSegment* stretch = SegmentAt(result.held, frame);
    if (stretch != nullptr &&
        (anchors.contains(stretch->first) || anchors.contains(stretch->last))) {
      const FrameId end = anchors.contains(stretch->first) ? stretch->first : stretch->last;
      result.center_in_world[frame] = anchors.at(end);
    } else {
      remaining.push_back(frame);
    }
  }

  std::map<FrameId, ResectionStart> starts;
  for (const FrameId frame : remaining) {
    ResectionStart& start = starts[frame];
    start.cam_from_world = result.cam_from_world.at(frame);
    start.center_in_world = InterpolatedCenter(anchors, timestamps_s, frame);
    const auto covariance = rotation_covariance.find(frame);
    if (covariance != rotation_covariance.end()) start.rotation_covariance = covariance->second;
  }
  ResectionOptions resection = options.resection;
  resection.has_motion_blur =
      std::any_of(result.bundles.begin(), result.bundles.end(), [](const BundleSummary& bundle) {
        return bundle.has_motion_blur;
      });
  const std::map<FrameId, ResectedPose> poses = ResectFrames(
      starts, result.map.point_in_world, all_tracks, result.camera, resection, num_threads);
  for (const auto& [frame, pose] : poses) {
    result.cam_from_world[frame] = pose.cam_from_world;
    result.center_in_world[frame] = pose.center_in_world;
  }
  result.num_resected = static_cast<int>(poses.size());
  const CenterMap known = result.center_in_world;
  for (const FrameId frame : remaining) {
    if (poses.contains(frame)) continue;
    result.center_in_world[frame] = InterpolatedCenter(known, timestamps_s, frame);
    ++result.num_interpolated;
  }
}

}  // namespace rotslam
