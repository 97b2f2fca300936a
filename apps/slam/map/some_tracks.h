#pragma once

#include <vector>

#include "rotodom/types/track.h"

namespace rotslam {

/// Tracks drawn at random until every frame has `observations_per_frame` observations, or all that
/// see it are drawn. A lens needs fewer than a map.
std::vector<Track> SomeTracks(std::vector<Track> tracks, int observations_per_frame);

}  // namespace rotslam
