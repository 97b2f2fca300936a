#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "rotodom/types/rotation.h"

namespace rotslam {

/// One frame's orientation, and how well it is known.
struct RotationRow {
  int frame = 0;
  double timestamp_s = 0.0;
  Rotation world_from_cam;
  // Standard deviations about the camera's own axes (x right, y down, z forward) against the first
  // frame, so that they grow with the drift; nullopt where nothing is known.
  std::optional<Eigen::Vector3d> sigma_deg;
  int inlier_edges = 0;            // edges of the view-graph that agree with the orientation
  std::vector<std::string> flags;  // words without commas, bars or blanks
};

/// rotations.csv: `frame,timestamp,qx,qy,qz,qw,sigma_x_deg,sigma_y_deg,sigma_z_deg,inlier_edges,
/// flags`, one line per row; the quaternion turns camera coordinates into the world's, as in
/// rotations_tum.txt. Unknown standard deviations are empty cells; flags are separated by '|'.
/// Throws std::invalid_argument for a number that is not finite or a flag that would break the
/// line, std::runtime_error when the file cannot be written; never leaves half a file.
void WriteRotationsCsv(const std::filesystem::path& path, const std::vector<RotationRow>& rows);

/// Reads what WriteRotationsCsv has written. Throws std::runtime_error with file, line and reason.
std::vector<RotationRow> ReadRotationsCsv(const std::filesystem::path& path);

}  // namespace rotslam
