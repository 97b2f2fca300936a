#pragma once

#include <vector>

#include "krot/structure/minimax_problem.h"
#include "rotodom/types/ids.h"
#include "rotodom/types/maps.h"
#include "rotodom/types/track.h"

namespace rotslam {

/// A MinimaxProblem with the names of its views and points.
struct NamedProblem {
  MinimaxProblem problem;
  std::vector<FrameId> views;
  std::vector<TrackId> tracks;
};

/// The problem of those tracks and of the views that they name, ascending.
/// @param tracks  bearings in front of their cameras; at least two observations each.
NamedProblem MakeProblem(const RotationMap& cam_from_world, const std::vector<Track>& tracks);

}  // namespace rotslam
