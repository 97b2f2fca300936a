#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

#include "apps/slam/map/refinement.h"
#include "ba/bundle_adjustment.h"
#include "krot/known_rotation.h"
#include "rotodom/types/maps.h"
#include "rotodom/types/pure_rotation_segment.h"
#include "rotodom/types/reconstruction.h"

namespace rotslam {

/// Positions and points, and how they came about.
struct MapResult {
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
  // Observations that one rotation a frame explains, where the camera only rotates throughout and
  // the calibration had to change for that; else zero.
  int num_rotation_observations = 0;
  int num_shallow_points = 0;  // left the cloud: seen under too small angles
  int num_cloud_outliers = 0;  // points that stood alone and left the cloud
  int num_resected = 0;
  int num_interpolated = 0;         // frames between keyframes whose position is interpolated
  bool is_held_throughout = false;  // the camera never changes its place: nothing to find
  std::string failure;              // why there is no map; empty when there is one
};

}  // namespace rotslam
