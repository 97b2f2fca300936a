#pragma once

#include "apps/slam/frame_source.h"
#include "apps/slam/map_result.h"
#include "apps/slam/observer.h"
#include "apps/slam/options.h"
#include "apps/slam/orientations.h"

namespace rotslam {

/// From orientations to positions and points: pure-rotation segments, keyframes and tracks, the
/// known-rotation problem, bundle adjustment with the keyframes' images, map correction, alignment
/// of components, the frames between keyframes, the cloud.
///
/// Parts of the map that no track with depth links keep their own scale (`components`). They are
/// put together by continuity (AlignComponent).
/// @param orientations  with features kept.
/// @param images        null: tracks are not completed, and the map is corrected by the places that
///                      the orientations have kept alone.
/// @return  with `failure` where there is no map.
MapResult BuildMap(const Orientations& orientations,
                   const SlamOptions& options,
                   ImageProvider* images,
                   SlamObserver& observer);

/// BuildMap up to bundle adjustment, without images: what asks for the lens or the keyframes alone
/// need not wait for the rest. Has no cloud, and the frames between keyframes no positions.
MapResult BuildKeyframeMap(const Orientations& orientations,
                           const SlamOptions& options,
                           SlamObserver& observer);

}  // namespace rotslam
