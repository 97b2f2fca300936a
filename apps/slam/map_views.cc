#include "apps/slam/map_views.h"

#include <array>
#include <optional>
#include <vector>

#include "apps/slam/map/resect_frames.h"
#include "apps/slam/zoom/without_zoom.h"
#include "rotodom/motion_blur/blurred_patch.h"
#include "rotodom/motion_blur/keypoint_blur.h"

namespace rotslam {
namespace {

// Makes a motion one by the rows of an image without its zoom: from one to the next of these, more
// time passes.
void FollowReadout(double scale, MapView& view) {
  double power = 1.0;
  for (auto column : view.motion.coefficients.colwise()) column *= power *= scale;
  view.velocity *= scale;
}

// The frames before and after one, or the two nearest on one side where the other has none.
std::array<FrameId, 2> NextTo(FrameId frame, const RotationMap& cam_from_world) {
  const int value = frame.value;
  if (!cam_from_world.contains(FrameId{value - 1})) return {FrameId{value + 1}, FrameId{value + 2}};
  if (!cam_from_world.contains(FrameId{value + 1})) return {FrameId{value - 1}, FrameId{value - 2}};
  return {FrameId{value - 1}, FrameId{value + 1}};
}

void SetTurnsWhileExposed(const Orientations& orientations, MapViews& views) {
  if (!(orientations.exposure_s > 0.0)) return;
  const auto time_s = [&](FrameId id) { return orientations.timestamps_s[id.value]; };
  for (auto& [frame, view] : views) {
    const auto rate = RateOf(frame, orientations.cam_from_world, time_s, kFarthestFrameForBlur_s);
    if (rate) view.rotation_while_exposed = orientations.exposure_s * *rate;
  }
}

}  // namespace

MapViews ReadMapViews(ImageProvider& images,
                      const std::set<FrameId>& frames,
                      const Orientations& orientations,
                      const std::function<void(const std::string& problem)>& tell) {
  MapViews views;
  images.Read(
      frames,
      [&](FrameId frame, const cv::Mat& image) {
        const FrameMasks& masks = orientations.masks;
        MaskedImage shown = image;
        if (!masks.IsEmpty()) shown.mask = masks.Of(orientations.image_names[frame.value]);
        const double scale = ScaleOf(orientations.focal_scales, frame);
        views[frame] =
            MakeMapView(scale == 1.0 ? shown : WithoutZoom(shown, orientations.camera, scale));
      },
      tell);
  return views;
}

void SetMotions(const MotionSources& sources, const Reconstruction& map, MapViews& views) {
  SetTurnsWhileExposed(sources.orientations, views);
  if (sources.camera.readout_s == 0.0) return;
  const RotationMap& cam_from_world = sources.orientations.cam_from_world;
  const auto time_s = [&](FrameId id) { return sources.orientations.timestamps_s[id.value]; };
  std::map<FrameId, ResectionStart> starts;
  for (auto& [frame, view] : views) {
    constexpr int kOrientations = 4;
    view.motion = MotionAt(frame, cam_from_world, time_s, kOrientations);
    const auto center = map.center_in_world.find(frame);
    if (center == map.center_in_world.end()) continue;
    for (const FrameId next : NextTo(frame, cam_from_world)) {
      const auto rotation = cam_from_world.find(next);
      if (rotation == cam_from_world.end()) continue;
      ResectionStart& start = starts[next];
      start.cam_from_world =
          rotation->second * cam_from_world.at(frame).Inverse() * map.cam_from_world.at(frame);
      start.center_in_world = center->second;
    }
  }
  const std::map<FrameId, ResectedPose> poses = ResectFrames(starts,
                                                             {map.point_in_world, sources.tracks},
                                                             sources.camera,
                                                             sources.resection,
                                                             sources.num_threads);
  for (auto& [frame, view] : views) {
    const auto center = map.center_in_world.find(frame);
    if (center == map.center_in_world.end()) continue;
    const TimedOrientation here{time_s(frame), map.cam_from_world.at(frame)};
    std::vector<TimedOrientation> others;
    std::vector<TimedOffset> ways;
    for (const FrameId next : NextTo(frame, cam_from_world)) {
      const auto pose = poses.find(next);
      if (pose == poses.end()) continue;
      others.push_back({time_s(next), pose->second.cam_from_world});
      ways.push_back({time_s(next) - here.time_s, pose->second.center_in_world - center->second});
    }
    // The map may have corrected the orientations since the odometry.
    if (others.size() == 2) view.motion = MotionThrough(here, others);
    view.velocity = PolynomialThrough(ways).col(0);
  }
  for (auto& [frame, view] : views) {
    const double scale = ScaleOf(sources.orientations.focal_scales, frame);
    if (scale != 1.0) FollowReadout(scale, view);
  }
}

std::map<FrameId, Features> DescribeViews(const MapViews& views,
                                          const Camera& camera,
                                          const FeatureOptions& options,
                                          int num_threads) {
  std::map<FrameId, Features> described;
  for (const auto& [frame, view] : views) {
    Features& corners = described[frame];
    corners = ExtractFeatures({view.image, view.mask}, frame, camera, options, num_threads);
    corners.rgb = {};
    MoveToMidFrame(camera, view.motion, corners);
  }
  return described;
}

}  // namespace rotslam
