#pragma once

#include <vector>

#include "apps/slam/orientations.h"

namespace rotslam {

/// The first frame of every connected component of the view-graph except the first one. Frames
/// without an edge belong to none.
/// @param cam_from_world  has an entry for each frame.
std::vector<FrameId> FindBreaks(const ViewGraph& graph, const RotationMap& cam_from_world);

/// Throws std::runtime_error, in one line that says what to look at, where there are fewer than
/// three frames or no edges.
void RequireFramesAndEdges(const Orientations& orientations);

}  // namespace rotslam
