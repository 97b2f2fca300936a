#pragma once

#include <vector>

#include <Eigen/Core>

#include "rotodom/types/track.h"

namespace rotslam {

/// A frame's points where they were seen, no rolling-shutter correction.
struct SeenPoints {
  double timestamp_s = 0.0;
  std::vector<TrackId> tracks;  // ascending
  std::vector<Eigen::Vector2d> keypoints_px;
};

}  // namespace rotslam
