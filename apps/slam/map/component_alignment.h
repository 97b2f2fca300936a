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

/// Frames and tracks around the boundary of two components.
struct AlignmentSources {
  const RotationMap& cam_from_world;  // of all frames; those that have a place as refined
  const std::vector<double>& timestamps_s;
  const std::vector<PureRotationSegment>& segments;
  const std::vector<Track>& tracks;  // of all frames
  const Camera& camera;
  const ResectionOptions& resection;
  int num_threads = 1;
};

/// Applies a similarity to the orientations, centres and points of a map.
Reconstruction Moved(const Reconstruction& part, const Similarity& similarity);

/// Aligns `part` with the components placed before it, where no measurement gives their relative
/// scale.
///
/// Scale: the median distance of the points seen by the keyframes within 30 frames of the boundary
/// is equal on both sides. Speed would be a worse measure: rotations and stops change it tenfold
/// (docs/gimbal.md). Place: within a pure-rotation segment the part begins where the other one
/// ends. Otherwise it is the median over frames near the boundary that see points of both maps.
/// Without such frames the path of the placed components is interpolated, or extrapolated with its
/// last velocity.
/// @param placed  at least one centre.
/// @param part    in a world and scale of its own, at least one centre; the frames' orientations in
///                `sources` are those of `placed`'s world.
Similarity AlignComponent(const Reconstruction& placed,
                          const Reconstruction& part,
                          const AlignmentSources& sources);

}  // namespace rotslam
