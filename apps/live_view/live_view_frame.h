#pragma once

#include <memory>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "apps/slam/live/live_map.h"
#include "apps/slam/live/live_slam.h"

namespace rotslam {

/// Numbers about a live session that its page shows.
struct LiveViewStats {
  double latency_ms = 0.0;  // from the frame to its pose
  double frames_per_s = 0.0;
  int num_dropped = 0;  // frames that came too fast
  int num_loops = 0;
};

/// The data of a frame that the page shows.
struct LiveViewFrame {
  LiveEstimate estimate;
  cv::Mat image;  // 8-bit, one channel or three (blue, green, red); empty: none
  std::vector<Eigen::Vector2d> points_px;  // in `image`, that the pose rests on
  std::shared_ptr<const LiveMap> map;      // null: there is none
  LiveViewStats stats;
};

}  // namespace rotslam
