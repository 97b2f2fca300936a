#pragma once

#include <vector>

#include <Eigen/Core>

#include "rotodom/features/features.h"
#include "rotodom/types/rotation.h"

namespace rotslam {

/// A frame whose points are tracked in later frames.
struct View {
  Features features;
  ImagePyramid pyramid;
  double timestamp_s = 0.0;
  // Per feature: image motion that the camera's rotation does not explain.
  std::vector<Eigen::Vector2d> flow_px_per_s;
  // Per feature: its bearing before CorrectRollingShutter; empty where that has to be computed.
  std::vector<Eigen::Vector3d> seen_bearings;
  // Per feature: an outlier of its frame's edges, no longer tracked.
  std::vector<bool> is_lost;
};

/// A view and its orientation.
struct OrientedView {
  const View* view = nullptr;
  Rotation cam_from_world;
};

/// Number of points that both frames see; both lists are ascending.
int CountCommonTracks(const std::vector<TrackId>& a, const std::vector<TrackId>& b);
/// The same for the `tracks` of two frames.
int CountCommonTracks(const Features& a, const Features& b);

/// Index of `track` in `features`, -1 when the frame does not see it.
int FindTrack(const Features& features, TrackId track);
/// The same in an ascending list.
int FindTrack(const std::vector<TrackId>& tracks, TrackId track);

}  // namespace rotslam
