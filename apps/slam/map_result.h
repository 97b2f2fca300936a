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

/// Positions and points, and how they were found.
struct MapResult {
  RotationMap cam_from_world;  // of every frame
  CenterMap center_in_world;   // of every frame
  Reconstruction map;          // refined keyframes, points and their tracks
  Reconstruction cloud;        // every frame, and the points of all tracks with enough parallax
  Camera camera;               // as the map's largest component has refined it
  std::set<FrameId> keyframes;
  std::vector<Track> keyframe_tracks;  // input of the known-rotation problem
  std::vector<PureRotationSegment> segments;
  std::vector<MapComponent> components;  // by their first keyframe
  KrotSolution krot;
  std::map<FrameId, PoseCovariance> pose_covariance;  // of refined keyframes, where asked for
  std::vector<BundleSummary> bundles;                 // one per component
  std::set<FrameId> relocalised;                      // keyframes that the map correction moved
  // Observations explained by rotations alone, where the camera rotates throughout and the
  // calibration was changed to show that; else zero.
  int num_rotation_observations = 0;
  int num_shallow_points = 0;  // removed from the cloud: too little parallax
  int num_cloud_outliers = 0;  // removed from the cloud: isolated points
  int num_resected = 0;
  int num_interpolated = 0;         // frames between keyframes whose position is interpolated
  bool rotates_throughout = false;  // pure rotation from the first frame to the last: no points
  std::string failure;              // why there is no map; empty when there is one
};

}  // namespace rotslam
