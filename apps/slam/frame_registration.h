#pragma once

#include <vector>

#include "apps/slam/map_result.h"
#include "apps/slam/options.h"
#include "apps/slam/orientations.h"

namespace rotslam {

/// Poses of the frames that `result.map` does not hold: resected against its points, their
/// orientations being measurements as good as AnchorCovariances says; in a segment, the place of
/// its end; interpolated where neither tells.
/// @param all_tracks  of all frames, those of the map's points among them.
/// @param result      has map, camera, segments, and orientations of all frames that follow the
///                    map's; gets the positions, better orientations and the counts.
void RegisterFrames(const Orientations& orientations,
                    const std::vector<Track>& all_tracks,
                    const SlamOptions& options,
                    MapResult& result);

}  // namespace rotslam
