#pragma once

#include <functional>
#include <map>
#include <optional>
#include <vector>

#include "ba/zoom/zoomed_projection.h"
#include "rotodom/camera/focal_scale.h"
#include "rotodom/odometry.h"
#include "rotodom/view_graph/zoom_check.h"

namespace rotslam {

/// Frames before a zoom, as a map of them alone has placed them.
struct FramesBeforeZoom {
  Camera camera;  // refined by that map
  std::map<FrameId, ZoomedPose> poses;
  bool moves = true;  // false: the camera only rotates, and points have no depth
};

/// Builds a map of a part of an odometry, seen through a camera; nullopt where there is none.
using MapOfPart = std::function<std::optional<FramesBeforeZoom>(const OdometryResult& part,
                                                                const Camera& camera)>;

/// A zoom and the focal length of its frames.
struct FollowedZoom {
  Zoom zoom;           // its frames and size as they came out
  FocalScales scales;  // of its frames, and of all that come after it
  Camera camera;       // refined by the map of the frames before
};

/// Follows a zoom frame by frame. The frames before it have one focal length: a map of them gives
/// points; each later frame is resected by these together with its focal length, and adds its rays
/// to them and to new points, until the focal length rests again. Then all these frames are
/// adjusted together. Later frames have the focal length at the end.
/// @param tracked  with features and matches.
/// @param camera   of the frames before the zoom.
/// @param zoom     where one was found (FindZooms); its size does not count.
/// @return  nullopt where the frames before it give no map, its frames show too few of its points,
///          or the focal length changes by less than kLeastLogZoom.
/// Error:   0.5 % of the focal length in every frame (0.3 px, f = 500; tests), 0.4 to 1.4 % in real
///          footage zoomed by 1.4 (docs/footage.md).
std::optional<FollowedZoom> FollowZoom(const OdometryResult& tracked,
                                       const Camera& camera,
                                       const Zoom& zoom,
                                       const MapOfPart& map_of_part);

}  // namespace rotslam
