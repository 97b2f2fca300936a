#pragma once

#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "apps/slam/map/calibration_check.h"
#include "apps/slam/map/frame_pose.h"
#include "apps/slam/map/refinement.h"
#include "ba/bundle_adjustment.h"
#include "krot/known_rotation.h"
#include "rotodom/sensor_orientations/sensor_types.h"
#include "rotodom/types/maps.h"
#include "rotodom/types/pure_rotation_segment.h"
#include "rotodom/types/reconstruction.h"
#include "rotodom/types/view_graph.h"

namespace rotslam {

/// The orientations of the first stage, computed again for another lens.
struct LensOrientations {
  ViewGraph graph;             // relative rotations
  RotationMap cam_from_world;  // averaged over them
};

/// Positions and points, and how they were found.
struct MapResult {
  RotationMap cam_from_world;                // of every frame
  CenterMap center_in_world;                 // of every frame
  std::map<FrameId, FramePose> frame_poses;  // of every frame: how its pose was found
  Reconstruction map;                        // refined keyframes, points and their tracks
  Reconstruction cloud;    // every frame, and the points of all tracks with enough parallax
  Camera camera;           // as the map's largest component has refined it
  LensSigmas lens_sigmas;  // of `camera`, see StatedSigmas
  // The same with the correlations of the parameters' errors, relative to `camera`; nullopt
  // where the map has not refined the lens.
  std::optional<LensCovariance> lens_covariance;
  CalibrationCheck calibration_check;  // of the largest component
  // Set where the lens was estimated and the map has refined it: the first stage's orientations
  // through `camera`, see TakeThroughLens.
  std::optional<LensOrientations> through_lens;
  std::set<FrameId> keyframes;
  std::vector<Track> keyframe_tracks;  // input of the known-rotation problem
  std::vector<PureRotationSegment> segments;
  std::vector<MapComponent> components;  // by their first keyframe
  KrotSolution krot;
  MapBracket final_bracket;  // of what bundle adjustment keeps, with its rotations
  std::map<FrameId, PoseCovariance> pose_covariance;  // of refined keyframes, where asked for
  std::vector<BundleSummary> bundles;                 // one per component
  // Of given orientations against those of the map, which drift less than the first ones.
  std::optional<SensorAlignment> sensor_alignment;
  std::set<FrameId> relocalised;  // keyframes that the map correction moved
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
