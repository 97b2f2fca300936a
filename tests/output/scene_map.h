#pragma once

#include <string>

#include "output/map/run_map.h"
#include "tests/scenes/scene.h"

namespace rotslam {

/// What a run would leave of a scene whose truth it has found: every fifth track without a point,
/// in every seventh the last sighting refuted, frames 10 apart in their numbers and every third of
/// them no keyframe. Keypoints have the ten bits behind the point that single precision can hold.
inline RunMap MapOfScene(const Scene& scene) {
  RunMap map;
  map.camera = scene.camera;
  map.image_folder = "/images of a scene";
  for (const auto& [frame, cam_from_world] : scene.true_cam_from_world) {
    map.frames.push_back({FrameId{10 * frame.value},
                          100.0 + 0.1 * frame.value,
                          "frame" + std::to_string(frame.value) + ".png",
                          frame.value % 3 != 2,
                          cam_from_world,
                          scene.true_center_in_world.at(frame)});
  }
  for (Track track : scene.tracks) {
    for (Observation& observation : track.observations) {
      observation.frame.value *= 10;
      observation.keypoint_px = (observation.keypoint_px * 1024.0).array().round() / 1024.0;
      observation.bearing = scene.camera.Unproject(observation.keypoint_px).value();
      observation.sigma_px = 0.5;
    }
    track.rgb = {static_cast<std::uint8_t>(track.id.value % 256), 20, 255};
    MapTrack entry{track,
                   std::nullopt,
                   std::vector<bool>(track.observations.size(), false),
                   std::vector<std::uint8_t>(track.observations.size())};
    for (std::size_t k = 0; k < entry.levels.size(); ++k) {
      entry.levels[k] = static_cast<std::uint8_t>((track.id.value + k) % 8);
    }
    if (track.id.value % 5 != 0) {
      entry.point_in_world = scene.true_point_in_world.at(track.id);
      entry.fits.assign(track.observations.size(), true);
      if (track.id.value % 7 == 0) entry.fits.back() = false;
    }
    map.tracks.push_back(std::move(entry));
  }
  for (std::size_t k = 1; k < map.frames.size(); ++k) {
    map.edges.push_back({map.frames[k - 1].id, map.frames[k].id, 100 + static_cast<int>(k), false});
  }
  return map;
}

inline Scene ExportScene() {
  SceneOptions options;
  options.num_views = 9;
  options.num_points = 300;
  options.noise_px = 0.5;
  return MakeScene(options);
}

}  // namespace rotslam
