#pragma once

#include <string>
#include <vector>

#include "apps/slam/map_result.h"
#include "output/tables/segments.h"

namespace rotslam {

/// The lines of segments.csv: cut where the kind of motion changes and, outside of pure-rotation
/// segments, where a component of the map begins.
std::vector<Segment> SegmentsOf(const MapResult& positions);

/// Comments for the trajectory files: one per segment whose scale nothing measures.
std::vector<std::string> CommentsOn(const std::vector<Segment>& segments);

}  // namespace rotslam
