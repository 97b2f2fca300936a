#pragma once

#include <map>
#include <string>
#include <vector>

#include "apps/slam/map_result.h"
#include "output/tables/segments.h"

namespace rotslam {

/// The lines of segments.csv: cut where the kind of motion changes and, outside of pure-rotation
/// segments, where another component of the map begins. Frames that nothing places are of the kind
/// `unplaced` and belong to no component.
std::vector<Segment> SegmentsOf(const MapResult& positions);

/// Comments for the trajectory files: one per segment whose scale nothing measures.
std::vector<std::string> CommentsOn(const std::vector<Segment>& segments);

/// Comments for the trajectory files: one per run of frames that are not measured.
std::vector<std::string> CommentsOn(const std::map<FrameId, FramePose>& poses);

}  // namespace rotslam
