#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "rotodom/types/trajectory.h"

namespace rotslam {

/// The pose of one frame and how it was found.
struct PoseRow {
  int frame = 0;
  StampedPose pose;
  // Standard deviations of the centre along the world's axes, in the trajectory's units; nullopt
  // where nothing is known.
  std::optional<Eigen::Vector3d> sigma;
  PoseState state = PoseState::kUnplaced;
  int component = -1;  // part of the map that it belongs to; -1: none
  std::string note;    // why, in words without commas, underscores or line ends; may be empty
};

/// The state as poses.csv spells it: measured, held, interpolated, extrapolated or unplaced.
const char* Name(PoseState state);

/// poses.csv: `frame,timestamp,x,y,z,qx,qy,qz,qw,sigma_x,sigma_y,sigma_z,state,component,note`, one
/// line per row; poses are camera->world, as in trajectory_tum.txt. Unknown standard deviations are
/// empty cells; the blanks of a note are written as underscores.
/// Throws std::invalid_argument for a number that is not finite or a note that would break the
/// line, std::runtime_error when the file cannot be written; never leaves half a file.
void WritePosesCsv(const std::filesystem::path& path, const std::vector<PoseRow>& rows);

/// Reads what WritePosesCsv has written. Throws std::runtime_error with file, line and reason.
std::vector<PoseRow> ReadPosesCsv(const std::filesystem::path& path);

}  // namespace rotslam
