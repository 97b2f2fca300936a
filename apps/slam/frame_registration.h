#pragma once

#include <vector>

#include "apps/slam/map_result.h"
#include "apps/slam/options.h"
#include "apps/slam/orientations.h"

namespace rotslam {

/// Registers the frames that `result.map` does not hold. A frame is resected against the points of
/// the map; its orientation enters as a measurement with the covariance of AnchorCovariances. Where
/// that fails, a frame of a pure-rotation segment takes the position of the end of the segment, and
/// any other frame is interpolated in time. Where a frame turns against the one before by another
/// angle than the odometry, by more than the deviations of both allow
/// (map/odometry_agreement.h), the frames up to the next keyframes get the odometry's orientations
/// and are resected again for their positions, unless their points refute that. `frame_poses` says
/// so.
/// @param all_tracks  of all frames, those of the map's points among them.
/// @param result      map, camera, segments and orientations of all frames, consistent with the
///                    map, must be set; receives the positions, refined orientations, the
///                    counts and `frame_poses`.
void RegisterFrames(const Orientations& orientations,
                    const std::vector<Track>& all_tracks,
                    const SlamOptions& options,
                    MapResult& result);

}  // namespace rotslam
