#pragma once

#include <map>

#include <Eigen/Core>

#include "rotodom/types/ids.h"
#include "rotodom/types/rotation.h"

namespace rotslam {

// Ordered maps: the order of a sum, and so its last bit, never depends on hashing.
using RotationMap = std::map<FrameId, Rotation>;       // cam_from_world
using CenterMap = std::map<FrameId, Eigen::Vector3d>;  // camera centre in the world
using PointMap = std::map<TrackId, Eigen::Vector3d>;   // scene point in the world

}  // namespace rotslam
