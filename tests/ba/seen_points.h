#pragma once

#include <random>
#include <vector>

#include "ba/resection.h"
#include "tests/ba/ba_scene.h"

namespace rotslam {

/// A camera and points that it sees.
struct PointsInView {
  Camera camera;
  Rotation cam_from_world;
  Eigen::Vector3d center_in_world;
  std::vector<PointObservation2D3D> observations;
};

/// @param outlier_ratio  of the observations, anywhere in the image.
inline PointsInView MakeView(CameraModel model,
                             int num_points,
                             double noise_px,
                             double outlier_ratio) {
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  PointsInView view;
  view.camera = BaCamera(model);
  view.cam_from_world = Rotation::Exp({0.2, -0.7, 0.1});
  view.center_in_world = {3.0, -1.0, 12.0};
  for (int k = 0; k < num_points; ++k) {
    const Eigen::Vector3d p(
        8.0 * uniform(random) - 4.0, 4.0 * uniform(random) - 2.0, 8.0 + 20.0 * uniform(random));
    PointObservation2D3D observation;
    observation.point_in_world = view.cam_from_world.Inverse() * p + view.center_in_world;
    observation.keypoint_px = *view.camera.Project(p);
    observation.keypoint_px += noise_px * Eigen::Vector2d(normal(random), normal(random));
    if (uniform(random) < outlier_ratio) {
      observation.keypoint_px = {1240.0 * uniform(random), 376.0 * uniform(random)};
    }
    observation.sigma_px = noise_px > 0.0 ? noise_px : 1.0;
    view.observations.push_back(observation);
  }
  return view;
}

inline double AngleErrorDeg(const ResectedPose& pose, const PointsInView& view) {
  return (pose.cam_from_world * view.cam_from_world.Inverse()).AngleDeg();
}

}  // namespace rotslam
