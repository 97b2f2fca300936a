#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "rotodom/types/trajectory.h"

namespace rotslam {

/// The orientations of a file.
struct OrientationFile {
  std::vector<StampedRotation> orientations;  // ascending in time, no time twice
  std::string form;                           // the form that the file was taken for
  std::vector<std::string> notes;             // what was assumed or left out, one line each
};

/// Reads orientations, camera->world: any trajectory with times that ReadTrajectoryFile reads, the
/// positions are not looked at, or a rotations.csv as WriteRotationsCsv writes it. A file without
/// times takes those of the times.txt beside it.
/// Throws std::runtime_error with file, line and reason: what ReadTrajectoryFile throws; no times;
/// a quaternion whose length is not 1 to a per cent; in a rotations.csv, a time that is there
/// twice.
OrientationFile ReadOrientationFile(const std::filesystem::path& path);

/// The orientations alone.
std::vector<StampedRotation> ReadOrientations(const std::filesystem::path& path);

}  // namespace rotslam
