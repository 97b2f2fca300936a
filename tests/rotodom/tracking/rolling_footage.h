#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>
#include <random>
#include <vector>

#include "rotodom/rolling_shutter/readout.h"
#include "rotodom/types/rotation.h"

namespace rotslam {

inline constexpr double kFootagePeriodS = 1.0 / 30.0;

using TurnAt = std::function<Rotation(double time_s)>;
using CenterAt = std::function<Eigen::Vector3d(double time_s)>;

// As an odometry that knows of no shutter leaves it, but for the errors of its orientations.
struct RollingFootage {
  Camera camera;
  std::map<FrameId, SeenPoints> frames;
  ViewGraph graph;
  RotationMap cam_from_world;

  std::optional<ReadoutEstimate> Estimate(int num_threads = 2) const {
    return EstimateReadout(camera, {frames, graph, cam_from_world}, {}, num_threads);
  }
};

// 400 points 2 to 6 m away, seen with a noise of 0.1 px.
inline RollingFootage FilmRolling(
    const TurnAt& turn, const CenterAt& way, double readout_s, ReadoutStart from, int count) {
  constexpr double kNoisePx = 0.1;
  RollingFootage footage;
  footage.camera.width = 640;
  footage.camera.height = 480;
  footage.camera.fx = footage.camera.fy = 500.0;
  footage.camera.cx = 319.5;
  footage.camera.cy = 239.5;
  Camera rolling = footage.camera;
  rolling.readout_s = readout_s;
  rolling.readout_from = from;
  std::mt19937 random(1);
  std::normal_distribution<double> noise_px(0.0, kNoisePx);
  std::uniform_real_distribution<double> place(-1.0, 1.0);
  std::vector<Eigen::Vector3d> points;
  for (int n = 0; n < 400; ++n) {
    const double depth = 4.0 + 2.0 * place(random);
    points.emplace_back(place(random) * depth, 0.75 * place(random) * depth, depth);
  }
  for (int k = 0; k < count; ++k) {
    const double mid_s = k * kFootagePeriodS;
    SeenPoints& seen = footage.frames[FrameId{k}];
    seen.timestamp_s = mid_s;
    footage.cam_from_world[FrameId{k}] = turn(mid_s);
    for (int n = 0; n < static_cast<int>(points.size()); ++n) {
      double exposed_s = 0.0;
      std::optional<Eigen::Vector2d> pixel;
      for (int step = 0; step < 6; ++step) {
        pixel = rolling.Project(turn(mid_s + exposed_s) * (points[n] - way(mid_s + exposed_s)));
        if (!pixel) break;
        exposed_s = rolling.ExposureTime(*pixel);
      }
      if (!pixel || pixel->x() < 0.0 || pixel->x() > 639.0 || pixel->y() < 0.0 ||
          pixel->y() > 479.0) {
        continue;
      }
      seen.tracks.push_back(TrackId{n});
      seen.keypoints_px.emplace_back(pixel->x() + noise_px(random), pixel->y() + noise_px(random));
    }
    for (int back = 1; back <= std::min(k, 4); ++back) {
      RelativeRotation edge;
      edge.i = FrameId{k - back};
      edge.j = FrameId{k};
      edge.j_from_i = turn(mid_s) * turn(mid_s - back * kFootagePeriodS).Inverse();
      edge.num_inliers = 200;
      footage.graph.AddEdge(edge);
    }
  }
  return footage;
}

inline Rotation Swing(double time_s) {
  return Rotation::Exp({0.08 * std::sin(6.0 * time_s), 0.1 * std::sin(8.0 * time_s), 0.0});
}

inline Eigen::Vector3d Stay(double /*time_s*/) { return Eigen::Vector3d::Zero(); }

// A hand that moves against what it looks at: to the right where the camera turns to the left.
inline Eigen::Vector3d MoveAgainstSwing(double time_s) {
  return {-0.3 * std::sin(8.0 * time_s), 0.2 * std::sin(6.0 * time_s), 0.1 * time_s};
}

}  // namespace rotslam
