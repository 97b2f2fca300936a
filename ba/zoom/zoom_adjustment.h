#pragma once

#include <map>
#include <set>
#include <vector>

#include "ba/zoom/focal_resection.h"
#include "rotodom/types/maps.h"
#include "rotodom/types/track.h"

namespace rotslam {

/// Frames around a zoom, some of them known already.
struct ZoomProblem {
  const Camera& camera;
  std::map<FrameId, ZoomedPose> poses;  // to start from
  std::set<FrameId> known;              // frames whose pose and focal length hold
  std::set<FrameId> unzoomed;           // frames that move, but have the camera's focal length
  std::set<FrameId> alike;              // frames that have one focal length
  bool moves = true;                    // false: no centre moves
  PointMap points;                      // to start from; others do not count
  const std::vector<Track>& tracks;     // keypoints as the zoomed images show them
  double noise_px = 1.0;                // of keypoints
};

/// Adjusts poses, focal lengths and points together. Focal lengths change smoothly, as far as the
/// keypoints let them.
/// @return  all poses.
/// Cost:    some seconds for 100 frames with 500 points each.
std::map<FrameId, ZoomedPose> AdjustZoom(const ZoomProblem& problem);

}  // namespace rotslam
