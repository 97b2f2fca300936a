#include <optional>
#include <stdexcept>

#include "output/map/ply.h"

namespace rotslam {
namespace {

std::optional<CloudPoint> MakePoint(const Track& track,
                                    const Eigen::Vector3d& point_in_world,
                                    const Reconstruction& reconstruction,
                                    const Camera& camera) {
  CloudPoint point;
  point.point_in_world = point_in_world;
  point.rgb = track.rgb;
  double error_sum_px = 0.0;
  for (const Observation& observation : track.observations) {
    const auto cam_from_world = reconstruction.cam_from_world.find(observation.frame);
    const auto center = reconstruction.center_in_world.find(observation.frame);
    if (cam_from_world == reconstruction.cam_from_world.end() ||
        center == reconstruction.center_in_world.end()) {
      continue;
    }
    const Eigen::Vector3d camera_to_point = point_in_world - center->second;
    const auto pixel = camera.Project(cam_from_world->second * camera_to_point);
    if (!pixel) continue;
    error_sum_px += (*pixel - observation.keypoint_px).norm();
    point.normal_in_world -= camera_to_point.normalized();
    ++point.num_observations;
  }
  if (point.num_observations == 0 || !point_in_world.allFinite()) return std::nullopt;
  point.mean_error_px = error_sum_px / point.num_observations;
  point.normal_in_world.stableNormalize();
  return point;
}

}  // namespace

std::vector<CloudPoint> MakeCloud(const Reconstruction& reconstruction, const Camera& camera) {
  if (const auto problem = camera.Problem()) {
    throw std::invalid_argument("MakeCloud: camera: " + *problem);
  }
  std::vector<CloudPoint> cloud;
  for (const Track& track : reconstruction.tracks) {
    const auto entry = reconstruction.point_in_world.find(track.id);
    if (entry == reconstruction.point_in_world.end()) continue;
    if (const auto point = MakePoint(track, entry->second, reconstruction, camera)) {
      cloud.push_back(*point);
    }
  }
  return cloud;
}

}  // namespace rotslam
