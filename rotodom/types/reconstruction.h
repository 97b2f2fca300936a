#pragma once

#include <vector>

#include "rotodom/types/maps.h"
#include "rotodom/types/track.h"

namespace rotslam {

/// Cameras and points in one world frame. A frame has a pose when it is in both `cam_from_world`
/// and `center_in_world`; a track has a point when its id is in `point_in_world`.
struct Reconstruction {
  RotationMap cam_from_world;
  CenterMap center_in_world;
  PointMap point_in_world;
  std::vector<Track> tracks;
};

}  // namespace rotslam
