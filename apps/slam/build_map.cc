#include "apps/slam/build_map.h"

#include <optional>
#include <utility>

#include "apps/slam/frame_registration.h"
#include "apps/slam/keyframe_map.h"
#include "apps/slam/map/cloud.h"
#include "apps/slam/map/some_tracks.h"
#include "rotodom/averaging/anchors.h"
#include "rotodom/motion_blur/keypoint_blur.h"

namespace rotslam {
namespace {

std::set<FrameId> AllFrames(const RotationMap& rotations) {
  std::set<FrameId> frames;
  for (const auto& [frame, rotation] : rotations) frames.insert(frame);
  return frames;
}

std::vector<Track> TracksOf(const Orientations& orientations, double blur_s_per_px) {
  std::vector<Track> tracks = BuildTracks(
      orientations.edge_matches, orientations.features, AllFrames(orientations.cam_from_world), 2);
  SetMotionBlur(orientations.camera, RatesOf(orientations), blur_s_per_px, tracks);
  return tracks;
}

// Without a map, frames have a position only where the camera never leaves its place.
void DescribeFramesWithoutMap(const Orientations& orientations, MapResult& result) {
  for (const auto& [frame, rotation] : result.cam_from_world) {
    FramePose& pose = result.frame_poses[frame];
    if (!result.rotates_throughout) {
      pose.note = "there is no map";
      continue;
    }
    const bool is_interpolated = orientations.unconnected.contains(frame);
    pose.state = is_interpolated ? PoseState::kInterpolated : PoseState::kHeld;
    pose.note = is_interpolated ? "orientation interpolated" : "position of a pure rotation";
  }
}

void RegisterRemainingFrames(const Orientations& orientations,
                             const std::vector<Track>& all_tracks,
                             const SlamOptions& options,
                             SlamObserver& observer,
                             MapResult& result) {
  observer.OnBegin(SlamStage::kFrameRegistration, -1);
  RegisterFrames(orientations, all_tracks, options, result);
  // Bundle adjustment has moved the frames between which these are interpolated.
  std::set<FrameId> unknown = orientations.unconnected;
  std::erase_if(unknown, [&](FrameId frame) { return result.map.cam_from_world.contains(frame); });
  InterpolateUnknown(orientations, unknown, result.cam_from_world);
  if (orientations.given) {
    result.sensor_alignment = AlignmentWithMap(
        *orientations.given, orientations.timestamps_s, result.cam_from_world, result.frame_poses);
  }
  observer.OnEnd(SlamStage::kFrameRegistration, result);
}

void MakeCloud(std::vector<Track> all_tracks,
               const SlamOptions& options,
               SlamObserver& observer,
               MapResult& result) {
  observer.OnBegin(SlamStage::kCloud, -1);
  BundleOptions bundle_options = options.ba;
  bundle_options.num_threads = options.num_threads;
  result.cloud = MakeCloudOf({result.camera,
                              result.cam_from_world,
                              result.center_in_world,
                              result.map.point_in_world,
                              result.segments},
                             std::move(all_tracks),
                             bundle_options);
  const auto num_points = result.cloud.point_in_world.size();
  result.cloud = WithoutShallowPoints(std::move(result.cloud), options.cloud_min_angle_deg);
  result.num_shallow_points = static_cast<int>(num_points - result.cloud.point_in_world.size());
  PointMap rest = WithoutOutliers(result.cloud.point_in_world, options.cloud_outliers);
  result.num_cloud_outliers = static_cast<int>(result.cloud.point_in_world.size() - rest.size());
  std::erase_if(result.cloud.tracks, [&](const Track& track) { return !rest.contains(track.id); });
  result.cloud.point_in_world = std::move(rest);
  observer.OnEnd(SlamStage::kCloud, result);
}

}  // namespace

MapResult BuildKeyframeMap(const Orientations& orientations,
                           const SlamOptions& options,
                           SlamObserver& observer,
                           int observations_per_frame) {
  observer.OnBegin(SlamStage::kTracks, -1);
  std::vector<Track> tracks = TracksOf(orientations, options.ba.blur_s_per_px);
  if (observations_per_frame > 0) tracks = SomeTracks(std::move(tracks), observations_per_frame);
  return MapKeyframes(orientations, tracks, options, nullptr, observer);
}

MapResult BuildMap(const Orientations& orientations,
                   const SlamOptions& options,
                   ImageProvider* images,
                   SlamObserver& observer) {
  observer.OnBegin(SlamStage::kTracks, -1);
  std::vector<Track> all_tracks = TracksOf(orientations, options.ba.blur_s_per_px);
  MapResult result = MapKeyframes(orientations, all_tracks, options, images, observer);
  if (result.components.empty()) {
    DescribeFramesWithoutMap(orientations, result);
    return result;
  }
  all_tracks = WithBearingsOf(result.camera, std::move(all_tracks));
  if (auto seen = ThroughFoundLens(orientations, result.camera, options)) {
    result.cam_from_world = FollowAnchors(
        seen->graph, seen->cam_from_world, result.map.cam_from_world, options.rotodom.averaging);
    RegisterRemainingFrames(*seen, all_tracks, options, observer, result);
    result.keyframe_tracks = WithBearingsOf(result.camera, std::move(result.keyframe_tracks));
    result.through_lens = {std::move(seen->graph), std::move(seen->cam_from_world)};
  } else {
    RegisterRemainingFrames(orientations, all_tracks, options, observer, result);
  }
  MakeCloud(std::move(all_tracks), options, observer, result);
  return result;
}

void TakeThroughLens(const MapResult& map, Orientations& orientations) {
  if (!map.through_lens) return;
  orientations.graph = map.through_lens->graph;
  orientations.cam_from_world = map.through_lens->cam_from_world;
  orientations.camera = map.camera;
}

}  // namespace rotslam
