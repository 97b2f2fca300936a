#pragma once

#include <algorithm>
#include <cmath>
#include <memory>
#include <random>
#include <utility>

#include <opencv2/core.hpp>

#include "apps/live_view/live_view_frame.h"
#include "rotodom/camera/camera.h"

namespace rotslam {

inline Camera SessionCamera() {
  Camera camera;
  camera.width = 160;
  camera.height = 120;
  camera.fx = camera.fy = 130.0;
  camera.cx = 79.5;
  camera.cy = 59.5;
  return camera;
}

/// A live session that nobody has filmed: a walk along an arc, with a stop in it where the camera
/// only rotates. Every fifth frame is a keyframe, which brings points, moves the newest ones and
/// takes some away; a loop moves all once.
class MadeUpSession {
 public:
  /// @param points_per_keyframe  new ones; so many of the newest move with each keyframe too.
  explicit MadeUpSession(int points_per_keyframe, int loop_at_frame = 100)
      : points_per_keyframe_(points_per_keyframe), loop_at_frame_(loop_at_frame) {}

  LiveViewFrame Next() {
    const int k = num_frames_++;
    LiveViewFrame frame;
    frame.estimate.frame = FrameId{k};
    frame.estimate.timestamp_s = 1e9 + k / 30.0;
    const bool rotates = k % 60 >= 40;
    if (!rotates) way_ += 0.05;
    heading_ += rotates ? 0.02 : 0.01;
    frame.estimate.cam_from_world = Rotation::Exp({0.0, -heading_, 0.0});
    frame.estimate.covariance = Eigen::Matrix3d::Identity() * 1e-6 * (1.0 + k);
    frame.estimate.num_points = 20;
    if (k >= 10) {
      frame.estimate.center_in_world = Center();
      frame.estimate.state = rotates ? LiveState::kRotating : LiveState::kTracking;
      if (k % 5 == 0) AddKeyframe(frame.estimate);
    }
    frame.estimate.map_revision = map_ ? map_->revision : 0;
    frame.map = map_;
    frame.image = cv::Mat(120, 160, CV_8UC3, cv::Scalar(k % 255, 90, 160));
    for (int n = 0; n < 20; ++n) frame.points_px.emplace_back(8.0 * n, 6.0 * n);
    frame.stats = {12.0, 30.0, 3, map_ ? map_->num_corrections : 0};
    return frame;
  }

  const std::shared_ptr<const LiveMap>& map() const { return map_; }

 private:
  Eigen::Vector3d Center() const { return {3.0 * std::sin(0.3 * way_), 0.0, way_}; }

  double Noise() { return std::uniform_real_distribution<double>(-1.0, 1.0)(random_); }

  void AddKeyframe(const LiveEstimate& estimate) {
    LiveMap map = map_ ? *map_ : LiveMap();
    ++map.revision;
    map.keyframes.push_back({estimate.frame,
                             estimate.timestamp_s,
                             estimate.cam_from_world,
                             *estimate.center_in_world,
                             0});
    const std::size_t num_moving =
        std::min(map.points.size(), static_cast<std::size_t>(points_per_keyframe_));
    for (std::size_t n = map.points.size() - num_moving; n < map.points.size(); ++n) {
      map.points[n].point_in_world.x() += 0.001 * Noise();
    }
    if (map.points.size() > 10) map.points.erase(map.points.begin() + 7);
    for (int n = 0; n < points_per_keyframe_; ++n) {
      const Eigen::Vector3d offset(4.0 * Noise(), 2.0 * Noise(), 5.0 + 2.0 * Noise());
      map.points.push_back({TrackId{num_tracks_++},
                            *estimate.center_in_world + offset,
                            {200, static_cast<std::uint8_t>(num_tracks_ % 256), 60}});
    }
    if (estimate.frame.value == loop_at_frame_) {
      ++map.num_corrections;
      for (LiveKeyframe& keyframe : map.keyframes) keyframe.center_in_world *= 1.02;
      for (LivePoint& point : map.points) point.point_in_world *= 1.02;
    }
    map_ = std::make_shared<const LiveMap>(std::move(map));
  }

  int points_per_keyframe_;
  int loop_at_frame_;
  int num_frames_ = 0;
  int num_tracks_ = 0;
  double way_ = 0.0;
  double heading_ = 0.0;
  std::mt19937 random_{1};
  std::shared_ptr<const LiveMap> map_;
};

}  // namespace rotslam
