#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

#include "apps/slam/map/frame_pose.h"
#include "apps/slam/map/refinement.h"
#include "ba/resection.h"
#include "rotodom/types/maps.h"
#include "rotodom/types/reconstruction.h"
#include "rotodom/types/view_graph.h"

namespace rotslam {

/// The result of frame registration.
struct Registration {
  std::map<FrameId, ResectedPose> measured;  // against points; keyframes with their covariance
  std::map<FrameId, FrameId> shared_center;  // in a pure rotation: the keyframe with its position
  std::set<FrameId> held_orientations;       // of `measured`; the points gave the position only
  std::map<FrameId, std::string> notes;
};

/// A map and the frames around it.
struct PoseSources {
  const Reconstruction& map;  // of the keyframes
  const std::vector<MapComponent>& components;
  const std::vector<Track>& tracks;  // of all frames, those of the map's points among them
  const ViewGraph& graph;
  const std::vector<double>& timestamps_s;
  const CenterMap& center_in_world;  // of all frames
  // Of the errors of keypoints over what their sigmas and residuals say, as edges show it.
  double variance_factor = 1.0;
  const std::map<FrameId, double>& orientation_sigma;  // rad, against the first frame
};

/// The state, component and position deviation of every frame of `sources.center_in_world`.
///
/// A frame whose position was not measured belongs to a component where the nearest frames before
/// and after it do, and the view-graph ties it to one of them or it has no edges. Then it is
/// interpolated. With such frames on one side only, and tied to these, it is extrapolated; else it
/// is unplaced: the positions of two components that nothing ties do not say what lies between.
/// Deviations: of measured frames, from the covariance of their registration, the size of their
/// residuals and variance_factor, and from the drift of the map: the way from the first frame of
/// the component has the direction, and about as well the scale, that the orientations have. Of the
/// others, from the frames around them and PathGrowth.
/// Error:   mean squared error / variance of positions after alignment 0.5 to 2 on rendered rooms
///          and streets with noise and with a rolling shutter (docs/measurements.md).
std::map<FrameId, FramePose> FindFramePoses(const PoseSources& sources,
                                            const Registration& registration);

}  // namespace rotslam
