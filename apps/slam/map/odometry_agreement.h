#pragma once

#include <map>
#include <optional>
#include <set>
#include <vector>

#include <Eigen/Core>

#include "rotodom/averaging/averaging.h"
#include "rotodom/types/maps.h"
#include "rotodom/types/view_graph.h"

namespace rotslam {

/// Angle between an orientation in the map and the odometry's.
struct OdometryDeparture {
  double angle_deg = 0.0;
  double sigmas = 0.0;  // Mahalanobis distance by the covariances of both

  /// Whether it is more than both deviations allow.
  bool IsTooFar() const;
};

/// The orientation of a frame and the covariance of its error, as of ResectedPose.
struct OrientationInMap {
  Rotation cam_from_world;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
};

/// Compares the rotation from one frame to another with the edge between them.
/// @param edge     from `before` to `after`.
OdometryDeparture DepartureOf(const RelativeRotation& edge,
                              const OrientationInMap& before,
                              const OrientationInMap& after,
                              const AveragingOptions& options);

/// Two successive keyframes of a component whose relative rotation is too far from the odometry's.
struct DepartingStep {
  FrameId first;
  FrameId last;
  OdometryDeparture departure;
};

/// @param cam_from_world  the odometry's, of all frames.
/// @param refined         of the keyframes, by bundle adjustment.
/// @param keyframes       of each component.
std::vector<DepartingStep> DepartingSteps(const ViewGraph& graph,
                                          const RotationMap& cam_from_world,
                                          const RotationMap& refined,
                                          const std::vector<std::set<FrameId>>& keyframes,
                                          const AveragingOptions& options);

}  // namespace rotslam
