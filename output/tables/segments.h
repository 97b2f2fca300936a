#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace rotslam {

/// A segment of frames of one kind of motion.
struct Segment {
  int first_frame = 0;
  int last_frame = 0;  // inclusive
  std::string kind;    // translating, rotating, still or unplaced
  int component = -1;  // part of the map whose scale is one; -1 where nothing places the frames
  // How its scale is tied to the rest: reference (it is the scale), tracks (points seen before and
  // after a turn in place), continuity (by default, nothing measures it) or none (no map).
  std::string scale;
  double evidence = 0.0;  // share of its edges that show no baseline
};

/// segments.csv: `first_frame,last_frame,kind,component,scale,evidence`. Throws std::runtime_error
/// when the file cannot be written.
void WriteSegments(const std::filesystem::path& path, const std::vector<Segment>& segments);

/// Reads what WriteSegments has written. Throws std::runtime_error with file, line and reason.
std::vector<Segment> ReadSegmentsCsv(const std::filesystem::path& path);

}  // namespace rotslam
