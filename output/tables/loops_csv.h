#pragma once

#include <filesystem>
#include <vector>

namespace rotslam {

/// A frame that looked like an older one, and whether geometry agreed.
struct LoopRow {
  int frame = 0;
  int match = 0;           // the older frame
  double score = 0.0;      // of their visual words, 0 to 1
  int inliers = 0;         // matches that agree with the relative rotation
  double angle_deg = 0.0;  // of the rotation around the loop, before it was closed
  bool accepted = false;
  // The factor of all rotations in between with which the loop closes best, and the angle left.
  double turn_scale = 1.0;
  double scaled_angle_deg = 0.0;
  int edges = 0;  // of the view-graph that come of it
};

/// loops.csv: `frame,match,score,inliers,angle_deg,accepted,turn_scale,scaled_angle_deg,edges`, one
/// line per row; accepted is 1 or 0. Throws std::invalid_argument for a number that is not finite,
/// std::runtime_error when the file cannot be written; never leaves half a file.
void WriteLoopsCsv(const std::filesystem::path& path, const std::vector<LoopRow>& rows);

/// Reads what WriteLoopsCsv has written. Throws std::runtime_error with file, line and reason.
std::vector<LoopRow> ReadLoopsCsv(const std::filesystem::path& path);

}  // namespace rotslam
