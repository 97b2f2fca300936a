#pragma once

#include <vector>

#include "ba/bundle_adjustment.h"
#include "rotodom/camera/camera.h"
#include "rotodom/types/maps.h"
#include "rotodom/types/pure_rotation_segment.h"
#include "rotodom/types/reconstruction.h"
#include "rotodom/types/track.h"

namespace rotslam {

/// Poses of all frames, from which a cloud is triangulated.
struct CloudSources {
  const Camera& camera;
  const RotationMap& cam_from_world;
  const CenterMap& center_in_world;
  const PointMap& point_in_world;  // known points, from which triangulation starts
  const std::vector<PureRotationSegment>& segments;
};

/// Triangulates the points of all tracks, not only those of the keyframes, from the poses of all
/// frames; in the memory of `tracks`, when they are moved in.
Reconstruction MakeCloudOf(const CloudSources& sources,
                           std::vector<Track> tracks,
                           const BundleOptions& options);

}  // namespace rotslam
