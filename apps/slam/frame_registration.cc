#include "apps/slam/frame_registration.h"

#include <algorithm>
#include <map>
#include <set>

#include "apps/slam/map/resect_frames.h"
#include "rotodom/averaging/anchors.h"

namespace rotslam {

void RegisterFrames(const Orientations& orientations,
                    const std::vector<Track>& all_tracks,
                    const SlamOptions& options,
                    MapResult& result) {
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
    // Within a segment the position equals that of the segment's end exactly.
    const PureRotationSegment* segment = SegmentAt(result.segments, frame);
    if (segment != nullptr &&
        (anchors.contains(segment->first) || anchors.contains(segment->last))) {
      const FrameId end = anchors.contains(segment->first) ? segment->first : segment->last;
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
  const std::map<FrameId, ResectedPose> poses =
      ResectFrames(starts,
                   {result.map.point_in_world, all_tracks},
                   result.camera,
                   resection,
                   options.num_threads);
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
