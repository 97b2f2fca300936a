#pragma once

#include <optional>
#include <string>

#include <Eigen/Core>

#include "rotodom/types/trajectory.h"

namespace rotslam {

/// How the pose of one frame was found, and how well its position is known.
struct FramePose {
  PoseState state = PoseState::kUnplaced;
  // Component of the map that it belongs to, -1: none. It is an interpolated or extrapolated
  // frame's only where the frames around it belong to that one, too.
  int component = -1;
  // Standard deviation of the centre along the world's axes, in the map's units, relative to the
  // points of its component; nullopt where nothing is known.
  std::optional<Eigen::Vector3d> position_sigma;
  std::string note;  // the reason where there is one to give, without commas
};

}  // namespace rotslam
