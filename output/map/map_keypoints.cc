#include "output/map/map_keypoints.h"

#include <algorithm>

#include "output/map/frame_cameras.h"

namespace rotslam {
namespace {

const MapFrame* FindFrame(const RunMap& map, FrameId id) {
  const auto found = std::lower_bound(
      map.frames.begin(), map.frames.end(), id, [](const MapFrame& frame, FrameId value) {
        return frame.id < value;
      });
  return found == map.frames.end() || found->id != id ? nullptr : &*found;
}

}  // namespace

int CountFits(const MapTrack& track) {
  return static_cast<int>(std::count(track.fits.begin(), track.fits.end(), true));
}

bool HasPoint(const MapTrack& track) {
  return track.point_in_world.has_value() && CountFits(track) >= 2;
}

std::map<FrameId, std::vector<MapKeypoint>> ListKeypoints(const RunMap& map) {
  std::map<FrameId, std::vector<MapKeypoint>> keypoints;
  for (const MapFrame& frame : map.frames) keypoints[frame.id];
  for (std::size_t t = 0; t < map.tracks.size(); ++t) {
    const MapTrack& entry = map.tracks[t];
    const bool is_point = HasPoint(entry);
    for (std::size_t k = 0; k < entry.fits.size(); ++k) {
      keypoints[entry.track.observations[k].frame].push_back(
          {static_cast<int>(t), static_cast<int>(k), is_point && entry.fits[k]});
    }
  }
  return keypoints;
}

std::vector<std::vector<int>> NumberKeypoints(const RunMap& map) {
  std::vector<std::vector<int>> numbers(map.tracks.size());
  for (std::size_t t = 0; t < numbers.size(); ++t) numbers[t].resize(map.tracks[t].fits.size());
  for (const auto& [frame, list] : ListKeypoints(map)) {
    for (std::size_t k = 0; k < list.size(); ++k) {
      numbers[list[k].track][list[k].observation] = static_cast<int>(k);
    }
  }
  return numbers;
}

double MeanErrorPx(const RunMap& map, const MapTrack& track) {
  if (!track.point_in_world) return 0.0;
  double sum_px = 0.0;
  int count = 0;
  for (std::size_t k = 0; k < track.fits.size(); ++k) {
    if (!track.fits[k]) continue;
    const Observation& observation = track.track.observations[k];
    const MapFrame* frame = FindFrame(map, observation.frame);
    if (frame == nullptr) continue;
    const auto pixel =
        CameraOf(map, frame->id)
            .Project(frame->cam_from_world * (*track.point_in_world - frame->center_in_world));
    if (!pixel) continue;
    sum_px += (*pixel - observation.keypoint_px).norm();
    ++count;
  }
  return count == 0 ? 0.0 : sum_px / count;
}

}  // namespace rotslam
