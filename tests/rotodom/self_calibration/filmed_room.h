#pragma once

#include <map>
#include <random>
#include <vector>

#include "rotodom/camera/camera.h"
#include "rotodom/features/features.h"
#include "rotodom/self_calibration/lens_from_pairs.h"
#include "rotodom/types/maps.h"

namespace rotslam {

/// A cloud of points around a camera that turns and moves, seen with noise.
struct FilmedRoom {
  std::map<FrameId, Features> features;  // no bearings
  RotationMap cam_from_world;
};

inline Camera LensOfModel(CameraModel model, double focal_px) {
  Camera camera;
  camera.model = model;
  camera.width = 640;
  camera.height = 480;
  camera.fx = camera.fy = focal_px;
  camera.cx = 319.5;
  camera.cy = 239.5;
  return camera;
}

/// @param step_m      between two frames; 0: a turn in place.
/// @param share_wrong  of the keypoints, anywhere in the image.
inline FilmedRoom FilmRoom(
    const Camera& camera, double step_m, double noise_px, double share_wrong, int num_frames = 40) {
  std::mt19937 random(5);
  std::normal_distribution<double> noise(0.0, noise_px);
  std::normal_distribution<double> place(0.0, 3.0);
  std::uniform_real_distribution<double> share(0.0, 1.0);
  std::vector<Eigen::Vector3d> points;
  for (int n = 0; n < 2500; ++n) points.emplace_back(place(random), place(random), place(random));
  FilmedRoom room;
  for (int k = 0; k < num_frames; ++k) {
    const double t = 0.15 * k;
    const Rotation cam_from_world =
        Rotation::Exp({0.25 * std::sin(t), 0.02 * k, 0.15 * std::sin(0.7 * t)});
    const Eigen::Vector3d center_in_world =
        step_m * Eigen::Vector3d(k, 4.0 * std::sin(0.5 * t), 3.0 * std::cos(0.4 * t));
    room.cam_from_world[FrameId{k}] = cam_from_world;
    Features& features = room.features[FrameId{k}];
    features.frame = FrameId{k};
    for (int n = 0; n < static_cast<int>(points.size()); ++n) {
      auto px = camera.Project(cam_from_world * (points[n] - center_in_world));
      if (!px || px->x() < 0.0 || px->y() < 0.0 || px->x() > camera.width - 1.0 ||
          px->y() > camera.height - 1.0) {
        continue;
      }
      *px += Eigen::Vector2d(noise(random), noise(random));
      if (share(random) < share_wrong) {
        *px = Eigen::Vector2d(camera.width * share(random), camera.height * share(random));
      }
      features.tracks.push_back(TrackId{n});
      features.keypoints_px.push_back(*px);
      features.bearings.emplace_back(Eigen::Vector3d::UnitZ());
    }
  }
  return room;
}

}  // namespace rotslam
