#pragma once

#include <map>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "rotodom/types/maps.h"
#include "rotodom/types/trajectory.h"
#include "rotodom/types/view_graph.h"

namespace rotslam {

/// Orientations of a gimbal, an IMU or another system.
struct OrientationsFromElsewhere {
  std::string name;                        // of their file, for messages
  std::vector<StampedRotation> rotations;  // timestamps ascending, two or more
};

/// Given orientations of all frames, and how well they agree with the images.
struct GivenRotations {
  std::string file;
  RotationMap cam_from_world;                     // of every frame
  std::map<FrameId, Eigen::Matrix3d> covariance;  // as in OdometryResult, where the file says
  double disagreement_deg = 0.0;                  // median angle between them and the edges
};

/// The given orientations at the times of the frames, interpolated over gaps of at most 0.2 s.
/// @param timestamps_s  by frame id.
/// @param graph         relative rotations measured in the images. Given orientations that fit them
///                      far better in another convention (inverse, other axes) are refused with an
///                      error that names the convention.
/// Throws std::runtime_error with one line where orientations are missing for some frames or follow
/// another convention.
GivenRotations MatchGivenRotations(const OrientationsFromElsewhere& given,
                                   const std::vector<double>& timestamps_s,
                                   const ViewGraph& graph);

}  // namespace rotslam
