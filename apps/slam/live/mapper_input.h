#pragma once

#include <map>
#include <vector>

#include "rotodom/features/features.h"
#include "rotodom/types/maps.h"
#include "rotodom/types/track.h"

namespace rotslam {

/// A keyframe of a live session, as LiveMapper takes it.
struct KeyframeInput {
  FrameId frame;
  double timestamp_s = 0.0;
  // Orientations of this keyframe and of those before it, by the odometry, in the odometry's own
  // world. Those of the newest frames may still change.
  RotationMap cam_from_world;
  std::map<FrameId, double> sigma_rad;  // of these, against the first frame
  bool only_rotated = false;            // the camera has kept its place since the last keyframe
  Features features;                    // with tracks
};

/// Two tracks that a loop has found to be of the same point.
struct RevisitedPoint {
  TrackId older;
  TrackId newer;
  std::vector<Observation> observations;  // of the older track, in keyframes around the older place
};

/// An older place that the camera has come back to.
struct RevisitedPlace {
  FrameId older;  // the keyframe nearest to the place
  std::vector<RevisitedPoint> points;
};

/// Loops that the odometry has closed, as LiveMapper takes them.
struct LoopInput {
  RotationMap cam_from_world;  // of all keyframes, by the odometry, after averaging
  std::vector<RevisitedPlace> places;
};

}  // namespace rotslam
