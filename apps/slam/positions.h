#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

#include "apps/cli/input/input.h"
#include "apps/cli/input/pipeline.h"
#include "apps/slam/orientations.h"
#include "apps/slam/refinement.h"

namespace rotslam {

/// Positions and points, and how they came about.
struct PositionResult {
  RotationMap cam_from_world;  // of every frame
  CenterMap center_in_world;   // of every frame
  Reconstruction map;          // refined keyframes, points and their tracks
  Reconstruction cloud;        // every frame, and every deep enough track that its poses explain
  Camera camera;               // as the map's largest component has refined it
  std::set<FrameId> keyframes;
  std::vector<Track> keyframe_tracks;  // as they went into the known-rotation problem
  std::vector<PureRotationSegment> held;
  std::vector<MapComponent> components;  // by their first keyframe
  KrotSolution krot;
  std::map<FrameId, PoseCovariance> pose_covariance;  // of refined keyframes, where asked for
  std::vector<BundleSummary> bundles;                 // one per component
  std::set<FrameId> relocalised;                      // keyframes that were in a wrong place
  int num_shallow_points = 0;                         // left the cloud: seen under too small angles
  int num_cloud_outliers = 0;                         // points that stood alone and left the cloud
  int num_resected = 0;
  int num_interpolated = 0;         // frames between keyframes whose position is interpolated
  bool is_held_throughout = false;  // the camera never changes its place: nothing to find
  std::string failure;              // why there is no map; empty when there is one
};

/// From orientations to positions and points: keyframes and tracks, the known-rotation problem,
/// bundle adjustment with the keyframes' images, then the frames between keyframes.
///
/// Parts of the map that no track with depth links keep their own scale (`components`). They are
/// put together by continuity (AlignComponent).
PositionResult FindPositions(const Input& input,
                             const Orientations& orientations,
                             const PipelineOptions& options,
                             int num_threads,
                             Progress& progress);

/// The first part of FindPositions, up to bundle adjustment, without images: what asks for the lens
/// or the keyframes alone need not wait for the rest. Has no cloud, and the frames between
/// keyframes no positions.
PositionResult FindKeyframePositions(const Orientations& orientations,
                                     const Camera& camera,
                                     const PipelineOptions& options,
                                     int num_threads,
                                     Progress& progress);

/// Camera->world poses of all frames of `centers`.
Trajectory MakeTrajectory(const std::vector<double>& timestamps_s,
                          const RotationMap& cam_from_world,
                          const CenterMap& centers);

}  // namespace rotslam
