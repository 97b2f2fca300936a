#pragma once

#include <map>
#include <vector>

#include "output/map/run_map.h"
#include "output/map/view_graph_matches.h"

namespace rotslam {

/// Gives frames cameras of their own: where the lens zooms, images show other pixels than the map's
/// camera would. Keypoints are moved to where the images show them.
/// @param cameras  like the map's camera, but for focal length and principal point.
void GiveFrameCameras(const std::map<FrameId, Camera>& cameras, RunMap& map);

/// Moves the keypoints of matches to where the images of the map's frames show them; those of other
/// frames stay.
void MoveToFrameCameras(const RunMap& map, ViewGraphMatches& matches);

/// The camera of a frame: its own, else the map's.
const Camera& CameraOf(const RunMap& map, FrameId frame);

/// The different cameras of a map's frames.
struct CameraList {
  std::vector<Camera> cameras;      // in the order of the frames
  std::map<FrameId, int> of_frame;  // positions in it
};
CameraList ListCameras(const RunMap& map);

}  // namespace rotslam
