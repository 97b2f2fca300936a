#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "rotodom/types/trajectory.h"

namespace rotslam {

/// Reads a trajectory; poses come back in ascending time, equal times in file order.
///
/// The number of columns tells the format, blanks or commas separate them, '#' starts a comment:
///   8   TUM:   timestamp tx ty tz qx qy qz qw, camera->world;
///   12  KITTI: the row-major 3x4 matrix [R t], camera->world.
/// @param times  for KITTI files: one timestamp in seconds per pose, extra ones are ignored.
///               Without it pose k has the timestamp k. TUM files have their own.
/// Throws std::runtime_error with file, line and reason: no poses, another number of columns, a
/// number that is not finite, a quaternion or matrix that is not a rotation, too few times.
Trajectory ReadTrajectory(const std::filesystem::path& path,
                          const std::optional<std::filesystem::path>& times = std::nullopt);

/// Timestamps of a KITTI file where none are named: times.txt in the same folder, if it is there.
std::optional<std::filesystem::path> TimesBeside(const std::filesystem::path& trajectory);

/// Writes the TUM format: timestamps with 9 decimals, the rest with 12 significant digits.
/// @param comments  lines that go before the poses, each behind a '#'.
/// Throws std::invalid_argument when a pose is not finite, std::runtime_error when the file cannot
/// be written; never leaves half a file.
void WriteTumTrajectory(const std::filesystem::path& path,
                        const Trajectory& trajectory,
                        const std::vector<std::string>& comments = {});

/// Writes the KITTI format, 12 significant digits; timestamps are not in it. Errors as above.
void WriteKittiTrajectory(const std::filesystem::path& path, const Trajectory& trajectory);

/// Writes poses in the columns of EuRoC's ground truth: `#timestamp [ns], p x y z [m], q w x y z`,
/// camera->world, 12 significant digits, whole nanoseconds. Errors as above.
void WriteEurocTrajectory(const std::filesystem::path& path, const Trajectory& trajectory);

}  // namespace rotslam
