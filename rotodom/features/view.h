#pragma once

#include <vector>

#include <Eigen/Core>

#include "rotodom/features/features.h"
#include "rotodom/types/rotation.h"

namespace rotslam {

/// What is kept of a frame while others look for its points.
struct View {
  Features features;
  ImagePyramid pyramid;
  double timestamp_s = 0.0;
  // Per feature: the motion of its keypoint that the camera's rotation does not explain.
  std::vector<Eigen::Vector2d> flow_px_per_s;
  // Per feature: refuted by its frame's edges, followed no longer.
  std::vector<bool> is_lost;
};

/// A view and where it looked.
struct OrientedView {
  const View* view = nullptr;
  Rotation cam_from_world;
};

/// Number of points that both frames show; both lists ascend.
int CountCommonTracks(const std::vector<TrackId>& a, const std::vector<TrackId>& b);
/// The same of their `tracks`.
int CountCommonTracks(const Features& a, const Features& b);

/// Position in `features` of `track`, -1 when the frame does not show it.
int FindTrack(const Features& features, TrackId track);
/// The same of a list that ascends.
int FindTrack(const std::vector<TrackId>& tracks, TrackId track);

}  // namespace rotslam
