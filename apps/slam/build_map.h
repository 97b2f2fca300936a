#pragma once

#include "apps/slam/input/frame_source.h"
#include "apps/slam/map_result.h"
#include "apps/slam/observer.h"
#include "apps/slam/options.h"
#include "apps/slam/orientations.h"

namespace rotslam {

/// Builds a map from orientations. The steps: pure-rotation segments, keyframes and tracks, known
/// rotation, bundle adjustment with the keyframes' images, map correction, alignment of the
/// components, registration of the frames between keyframes, the cloud.
///
/// Keyframes that share no tracks with depth form components, each with a scale of its own
/// (`components`). AlignComponent joins them.
/// @param orientations  with features kept.
/// @param images        null: tracks are not completed, and the map is corrected with the places
///                      that the orientations hold alone.
/// @return  `failure` is set where there is no map.
MapResult BuildMap(const Orientations& orientations,
                   const SlamOptions& options,
                   ImageProvider* images,
                   SlamObserver& observer);

/// Gives the relative and absolute orientations that belong to the map's camera, where the map has
/// them (MapResult::through_lens), and that camera.
void TakeThroughLens(const MapResult& map, Orientations& orientations);

/// Runs BuildMap up to bundle adjustment and without images, for callers that need only the lens or
/// the keyframes. The result has no cloud and no positions of the frames between keyframes.
MapResult BuildKeyframeMap(const Orientations& orientations,
                           const SlamOptions& options,
                           SlamObserver& observer,
                           int observations_per_frame = 0);

}  // namespace rotslam
