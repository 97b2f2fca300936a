#pragma once

#include <vector>

#include "apps/slam/input/frame_source.h"
#include "apps/slam/map_result.h"
#include "apps/slam/observer.h"
#include "apps/slam/options.h"
#include "apps/slam/orientations.h"

namespace rotslam {

/// Builds the map of the keyframes: the steps of BuildMap from pure-rotation segments to the
/// alignment of the components.
/// @param all_tracks  of all frames, with motion blur.
/// @param images      null: tracks are not completed (see BuildMap).
/// @return  without `components` where there is no map; `failure` says why, unless the camera
///          rotates throughout.
MapResult MapKeyframes(const Orientations& orientations,
                       const std::vector<Track>& all_tracks,
                       const SlamOptions& options,
                       ImageProvider* images,
                       SlamObserver& observer);

}  // namespace rotslam
