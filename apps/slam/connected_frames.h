#pragma once

#include <vector>

#include "apps/slam/orientations.h"

namespace rotslam {

/// The first frame of every connected component of the view-graph except the first one. Frames
/// without an edge belong to none.
/// @param cam_from_world  has an entry for each frame.
std::vector<FrameId> FindBreaks(const ViewGraph& graph, const RotationMap& cam_from_world);

/// Whether orientations are given for the frames on both sides of a break.
bool IsBridged(const GivenRotations& given, FrameId frame);

/// The first frame of every piece that only a few matches tie to those before it, where these had
/// to be sought all over the image: the rotation across can be wrong by degrees.
std::vector<FrameId> FindWeakTies(const Orientations& orientations);

/// Throws std::runtime_error, in one line that says what to look at, where there are fewer than
/// three frames or no edges.
void RequireFramesAndEdges(const Orientations& orientations);

}  // namespace rotslam
