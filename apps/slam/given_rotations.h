#pragma once

#include <map>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "rotodom/types/maps.h"
#include "rotodom/types/trajectory.h"
#include "rotodom/types/view_graph.h"

namespace rotslam {

/// Orientations from a gimbal, an IMU or another system.
struct OrientationsFromElsewhere {
  std::string name;                        // of their file, for messages
  std::vector<StampedRotation> rotations;  // timestamps ascending, two or more
};

/// Orientations that come from elsewhere, and how they fit the images.
struct GivenRotations {
  std::string file;
  RotationMap cam_from_world;                     // of every frame
  std::map<FrameId, Eigen::Matrix3d> covariance;  // as in OdometryResult, where the file says
  double disagreement_deg = 0.0;                  // median angle between them and the edges
};

/// The given orientations at the times of the frames, interpolated over gaps of at most 0.2 s.
/// @param timestamps_s  by frame id.
/// @param graph         relative rotations of the images: where they fit the given orientations far
///                      better in another convention, that is an error that names it.
/// Throws std::runtime_error in one line: frames that the orientations do not cover, a convention
/// that is not ours.
GivenRotations MatchGivenRotations(const OrientationsFromElsewhere& given,
                                   const std::vector<double>& timestamps_s,
                                   const ViewGraph& graph);

}  // namespace rotslam
