#include "ba/window.h"

#include <algorithm>

namespace rotslam {

BundleProblem WindowProblem(const Reconstruction& map,
                            const Camera& camera,
                            const std::set<FrameId>& window) {
  BundleProblem problem;
  problem.camera = camera;
  const auto has_pose = [&](FrameId frame) {
    return map.cam_from_world.contains(frame) && map.center_in_world.contains(frame);
  };
  const auto take = [&](FrameId frame) {
    problem.start.cam_from_world[frame] = map.cam_from_world.at(frame);
    problem.start.center_in_world[frame] = map.center_in_world.at(frame);
  };
  for (const FrameId frame : window) {
    if (has_pose(frame)) take(frame);
  }
  if (problem.start.cam_from_world.empty()) return problem;
  for (const Track& track : map.tracks) {
    const bool is_seen = std::any_of(
        track.observations.begin(), track.observations.end(), [&](const Observation& observation) {
          return window.contains(observation.frame) && has_pose(observation.frame);
        });
    if (!is_seen) continue;
    problem.start.tracks.push_back(track);
    const auto point = map.point_in_world.find(track.id);
    if (point != map.point_in_world.end()) problem.start.point_in_world.insert(*point);
    for (const Observation& observation : track.observations) {
      if (window.contains(observation.frame) || !has_pose(observation.frame)) continue;
      if (problem.fixed_frames.insert(observation.frame).second) take(observation.frame);
    }
  }
  return problem;
}

void TakeWindow(const BundleProblem& window, const BundleResult& refined, Reconstruction& map) {
  if (!refined.Usable()) return;
  const Reconstruction& found = refined.reconstruction;
  for (const auto& [frame, cam_from_world] : found.cam_from_world) {
    if (window.fixed_frames.contains(frame)) continue;
    map.cam_from_world[frame] = cam_from_world;
    const auto center = found.center_in_world.find(frame);
    if (center != found.center_in_world.end()) map.center_in_world[frame] = center->second;
  }
  std::set<TrackId> replaced;
  for (const Track& track : window.start.tracks) {
    replaced.insert(track.id);
    map.point_in_world.erase(track.id);
  }
  std::erase_if(map.tracks, [&](const Track& track) { return replaced.contains(track.id); });
  map.tracks.insert(map.tracks.end(), found.tracks.begin(), found.tracks.end());
  map.point_in_world.insert(found.point_in_world.begin(), found.point_in_world.end());
}

}  // namespace rotslam
