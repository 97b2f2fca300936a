#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "output/trajectory/trajectory_file.h"
#include "rotodom/types/trajectory.h"

namespace rotslam {

/// Reads a trajectory, camera->world, in any of the forms of output/trajectory_form.h: TUM, KITTI,
/// EuRoC and others, or a folder with a file per pose. Blanks, commas or semicolons separate the
/// columns, '#' starts a comment, a line of words names the columns.
///
/// Poses that a system has marked as lost (nan, a zero quaternion or matrix) and a time that is
/// there again are left out; the notes count them.
/// @param times  for files without times: one timestamp per pose, extra ones are ignored. Without
///               it pose k has the timestamp k.
/// Throws std::runtime_error with file, line and reason: no poses, columns of no known form, a
/// quaternion or matrix that is not a rotation, too few times.
TrajectoryFile ReadTrajectoryFile(const std::filesystem::path& path,
                                  const std::optional<std::filesystem::path>& times = std::nullopt);

/// The poses alone.
Trajectory ReadTrajectory(const std::filesystem::path& path,
                          const std::optional<std::filesystem::path>& times = std::nullopt);

/// Name of the form that a file would be read in; nullopt when it is no trajectory.
/// Throws std::runtime_error when it cannot be read at all.
std::optional<std::string> RecogniseTrajectory(const std::filesystem::path& path);

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
