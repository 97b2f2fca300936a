#pragma once

#include <array>
#include <vector>

#include <Eigen/Core>

#include "rotodom/features/features.h"

namespace rotslam {

/// The keypoints of one track in two frames.
struct SharedPoint {
  Eigen::Vector2d i_px;
  Eigen::Vector2d j_px;
};

/// The keypoints of both frames that see the same track, by their positions in the frames.
std::vector<std::array<int, 2>> FindCommonPoints(const Features& view_i, const Features& view_j);

std::vector<SharedPoint> SharedPoints(const Features& i, const Features& j);

}  // namespace rotslam
