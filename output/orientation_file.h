#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "rotodom/types/rotation.h"

namespace rotslam {

/// An orientation at a time, from elsewhere.
struct StampedRotation {
  double timestamp_s = 0.0;
  Rotation world_from_cam;
  // Standard deviations about the camera's axes; nullopt where the file does not say.
  std::optional<Eigen::Vector3d> sigma_deg;
};

/// Reads orientations, camera->world: a TUM file (`timestamp tx ty tz qx qy qz qw`, the positions
/// are not looked at) or a rotations.csv as WriteRotationsCsv writes it.
/// @return  ascending in time.
/// Throws std::runtime_error with file, line and reason: no lines, another number of columns, a
/// number that is not finite, a quaternion whose length is not 1 to a per cent, a time that is
/// there twice.
std::vector<StampedRotation> ReadOrientations(const std::filesystem::path& path);

}  // namespace rotslam
