#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "apps/slam/zoom/follow_zoom.h"

namespace rotslam {

/// How relative rotations are estimated anew.
struct ZoomOptions {
  const OdometryOptions& odometry;
  std::uint64_t seed = 1;
  int num_threads = 1;
};

/// An odometry whose zooms were followed.
struct ZoomsFollowed {
  Camera camera;            // at the beginning, as the map of the first frames has refined it
  FocalScales scales;       // of the frames
  OdometryResult odometry;  // as the camera would have shown it without zooms, see WithoutZoom
  // The zooms with their frames and sizes as they came out, and those that could not be followed,
  // ascending.
  std::vector<Zoom> zooms;
};

/// Follows zooms one after the other. The odometry without the first one tells where the next one
/// is.
/// @param filmed  with features and matches.
/// @param zooms   as FindZooms has found them.
/// @return  nullopt where the first zoom cannot be followed, or where pairs of frames do not agree
///          better with the focal lengths found than with one for all.
std::optional<ZoomsFollowed> FollowZooms(const OdometryResult& filmed,
                                         const Camera& camera,
                                         const std::vector<Zoom>& zooms,
                                         const MapOfPart& map_of_part,
                                         const ZoomOptions& options);

/// Whether the focal length at the end of a zoom is the one that it tells, to 2 %.
bool IsFollowed(const Zoom& zoom, const FocalScales& scales);

}  // namespace rotslam
