#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "rotodom/types/rotation.h"

namespace rotslam {

/// A camera pose at a time, camera->world as trajectory files have it.
struct StampedPose {
  double timestamp_s = 0.0;
  Rotation world_from_cam;
  Eigen::Vector3d center_in_world = Eigen::Vector3d::Zero();
};

using Trajectory = std::vector<StampedPose>;  // timestamps ascending

/// How the pose of a frame was found.
enum class PoseState {
  kMeasured,      // from the map's points
  kHeld,          // measured but for the position of a pure rotation, or the odometry's orientation
  kInterpolated,  // its position lies between those of frames before and after it
  kExtrapolated,  // its position is that of the nearest frame that has one, on one side only
  kUnplaced,      // nothing ties it to the map: its position means nothing
};

/// An orientation at a time.
struct StampedRotation {
  double timestamp_s = 0.0;
  Rotation world_from_cam;
  // Standard deviations about the camera's axes, deg; nullopt where nothing is known.
  std::optional<Eigen::Vector3d> sigma_deg;
};

/// The pose at a time: rotations by spherical linear interpolation, positions linearly.
/// @param exact_s    a pose this near in time counts as the one asked for, whatever the gap.
/// @param max_gap_s  largest gap between two poses to interpolate over.
/// @return  nullopt where the trajectory does not reach, or has fewer than two poses.
std::optional<StampedPose> PoseAt(const Trajectory& trajectory,
                                  double timestamp_s,
                                  double exact_s,
                                  double max_gap_s);

}  // namespace rotslam
