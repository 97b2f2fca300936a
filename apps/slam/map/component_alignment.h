#pragma once

#include <vector>

#include "ba/resection.h"
#include "rotodom/camera/camera.h"
#include "rotodom/types/maps.h"
#include "rotodom/types/pure_rotation_segment.h"
#include "rotodom/types/reconstruction.h"
#include "rotodom/types/similarity.h"
#include "rotodom/types/track.h"

namespace rotslam {

/// What is known of the frames around a boundary.
struct AlignmentSources {
  const RotationMap& cam_from_world;  // of all frames; those that have a place as refined
  const std::vector<double>& timestamps_s;
  const std::vector<PureRotationSegment>& held;
  const std::vector<Track>& tracks;  // of all frames
  const Camera& camera;
  const ResectionOptions& resection;
  int num_threads = 1;
};

/// A map with its orientations, centres and points moved.
Reconstruction Moved(const Reconstruction& part, const Similarity& similarity);

/// Where and how large `part` goes behind what is placed already, no measurement telling its scale.
///
/// Scale: what the keyframes within 30 frames of the boundary see is as far away on both sides, by
/// the median. That holds better than speed does, which turns and stops change tenfold
/// (docs/gimbal.md). Place: within a pure-rotation segment the part starts where the other one
/// ends. Else frames near the boundary that see points of both maps tell it, by the median; else
/// the path of what is placed, interpolated or as far on as its last velocity carries.
/// @param placed  at least one centre.
/// @param part    in a world and scale of its own, at least one centre; the frames' orientations in
///                `sources` are those of `placed`'s world.
Similarity AlignComponent(const Reconstruction& placed,
                          const Reconstruction& part,
                          const AlignmentSources& sources);

}  // namespace rotslam
