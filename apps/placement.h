#pragma once

#include <vector>

#include "apps/positions.h"

namespace rotslam {

/// Poses of the frames that `result.map` does not hold: resected against its points, their
/// orientations being measurements as good as AnchorCovariances says; in a stretch, the place of
/// its end; interpolated where neither tells.
/// @param all_tracks  of all frames, those of the map's points among them.
/// @param result      has map, camera, stretches, and orientations of all frames that follow the
///                    map's; gets the positions, better orientations and the counts.
void PlaceRemainingFrames(const Orientations& orientations,
                          const std::vector<Track>& all_tracks,
                          const PipelineOptions& options,
                          int num_threads,
                          PositionResult& result);

}  // namespace rotslam
