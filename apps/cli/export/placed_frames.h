#pragma once

#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include "output/map/run_map.h"

namespace rotslam {

/// The frames of a map that have a position, by the scale in which these are measured.
struct PlacedFrames {
  // Components of the map, by their first frame; no measurement ties the scale of one to that of
  // another. Empty where no frame has a position.
  std::vector<std::set<FrameId>> components;
  std::set<FrameId> unplaced;
};

/// Reads `segments.csv` of a run. Without one, all frames are one component.
/// A frame in a pure rotation between two components has the same place in both: it belongs to the
/// one whose points it sees more of.
/// Throws std::runtime_error where the table is damaged.
PlacedFrames FindPlacedFrames(const std::filesystem::path& run, const RunMap& map);

/// The frames of a run during which the camera does not change its place, by `segments.csv`.
std::set<FrameId> FramesAtRest(const std::filesystem::path& run, const RunMap& map);

/// "3, 7-12, 40": numbers and ranges, ascending; of many the first ones and "...".
std::string DescribeFrames(const std::set<FrameId>& frames);

}  // namespace rotslam
