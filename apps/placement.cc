#include "apps/placement.h"

#include <iterator>
#include <map>
#include <optional>
#include <set>

#include "ba/resection.h"
#include "rotodom/averaging/anchors.h"
#include "rotodom/types/parallel.h"

namespace rotslam {
namespace {

// Position between the nearest frames that have one, linear in time.
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

}  // namespace

void PlaceRemainingFrames(const Orientations& orientations,
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
    // Inside a stretch the place is that of its ends, to the last bit.
    const HeldStretch* stretch = StretchAt(result.held, frame);
    if (stretch != nullptr &&
        (anchors.contains(stretch->first) || anchors.contains(stretch->last))) {
      const FrameId end = anchors.contains(stretch->first) ? stretch->first : stretch->last;
      result.center_in_world[frame] = anchors.at(end);
    } else {
      remaining.push_back(frame);
    }
  }

  std::map<FrameId, std::vector<PointSighting>> sightings;
  for (const Track& track : all_tracks) {
    const auto point = result.map.point_in_world.find(track.id);
    if (point == result.map.point_in_world.end()) continue;
    for (const Observation& observation : track.observations) {
      sightings[observation.frame].push_back(
          {point->second, observation.keypoint_px, observation.sigma_px});
    }
  }
  std::vector<std::optional<ResectedPose>> poses(remaining.size());
  static const std::vector<PointSighting> kNone;
  ParallelFor(static_cast<int>(remaining.size()), num_threads, [&](int k) {
    const FrameId frame = remaining[k];
    const auto seen = sightings.find(frame);
    ResectionStart start{result.cam_from_world.at(frame),
                         InterpolatedCenter(anchors, timestamps_s, frame),
                         std::nullopt};
    const auto covariance = rotation_covariance.find(frame);
    if (covariance != rotation_covariance.end()) start.rotation_covariance = covariance->second;
    poses[k] = ResectFrame(
        result.camera, seen == sightings.end() ? kNone : seen->second, start, options.resection);
  });
  for (std::size_t k = 0; k < remaining.size(); ++k) {
    if (poses[k]) {
      result.cam_from_world[remaining[k]] = poses[k]->cam_from_world;
      result.center_in_world[remaining[k]] = poses[k]->center_in_world;
      ++result.num_resected;
    }
  }
  const CenterMap known = result.center_in_world;
  for (std::size_t k = 0; k < remaining.size(); ++k) {
    if (poses[k]) continue;
    result.center_in_world[remaining[k]] = InterpolatedCenter(known, timestamps_s, remaining[k]);
    ++result.num_interpolated;
  }
}

}  // namespace rotslam
