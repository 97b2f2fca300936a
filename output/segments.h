#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace rotslam {

/// A stretch of frames of one kind of motion.
struct Segment {
  int first_frame = 0;
  int last_frame = 0;     // inclusive
  std::string kind;       // translating, rotating or still
  int component = -1;     // part of the map whose scale is one; -1 where there is no map
  std::string scale;      // how it is tied to the rest: reference, continuity (by default) or none
  double evidence = 0.0;  // share of its edges that show no baseline
};

/// segments.csv: `first_frame,last_frame,kind,component,scale,evidence`. Throws std::runtime_error
/// when the file cannot be written.
void WriteSegments(const std::filesystem::path& path, const std::vector<Segment>& segments);

}  // namespace rotslam
