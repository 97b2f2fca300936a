#include "output/map/frame_cameras.h"

#include <algorithm>
#include <iterator>

namespace rotslam {
namespace {

// Where `to` shows what `from` shows at a pixel; they differ in focal length and principal point.
Eigen::Vector2d MovedPixel(const Camera& from, const Camera& to, const Eigen::Vector2d& pixel) {
  return {to.cx + to.fx / from.fx * (pixel.x() - from.cx),
          to.cy + to.fy / from.fy * (pixel.y() - from.cy)};
}

}  // namespace

void GiveFrameCameras(const std::map<FrameId, Camera>& cameras, RunMap& map) {
  for (const MapFrame& frame : map.frames) {
    const auto own = cameras.find(frame.id);
    if (own != cameras.end()) map.frame_cameras[frame.id] = own->second;
  }
  for (MapTrack& entry : map.tracks) {
    for (Observation& seen : entry.track.observations) {
      seen.keypoint_px = MovedPixel(map.camera, CameraOf(map, seen.frame), seen.keypoint_px);
    }
  }
}

void MoveToFrameCameras(const RunMap& map, ViewGraphMatches& matches) {
  for (auto& [frame, keypoints_px] : matches.keypoints_px) {
    const Camera& own = CameraOf(map, frame);
    for (Eigen::Vector2f& keypoint_px : keypoints_px) {
      keypoint_px = MovedPixel(map.camera, own, keypoint_px.cast<double>()).cast<float>();
    }
  }
}

const Camera& CameraOf(const RunMap& map, FrameId frame) {
  const auto own = map.frame_cameras.find(frame);
  return own == map.frame_cameras.end() ? map.camera : own->second;
}

CameraList ListCameras(const RunMap& map) {
  CameraList list;
  for (const MapFrame& frame : map.frames) {
    const Camera& camera = CameraOf(map, frame.id);
    const auto found = std::find(list.cameras.begin(), list.cameras.end(), camera);
    list.of_frame[frame.id] = static_cast<int>(std::distance(list.cameras.begin(), found));
    if (found == list.cameras.end()) list.cameras.push_back(camera);
  }
  if (list.cameras.empty()) list.cameras.push_back(map.camera);
  return list;
}

}  // namespace rotslam
