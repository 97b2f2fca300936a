#pragma once

#include <map>
#include <optional>
#include <vector>

#include "ba/bundle_adjustment.h"
#include "krot/krot_options.h"
#include "rotodom/camera/camera.h"
#include "rotodom/types/reconstruction.h"

namespace rotslam {

/// Keyframes from which a component of a live map is built.
struct ComponentSources {
  RotationMap cam_from_world;           // by the odometry; none has a place yet
  std::map<FrameId, double> sigma_rad;  // of these
  std::vector<Track> tracks;            // may have observations in other frames, too
};

/// A component of a live map, in a world and scale of its own.
struct BuiltComponent {
  Reconstruction map;
  // Its parallax suffices for adjustment to notice errors of the start. Until then the component
  // is better built anew with the next keyframe.
  bool has_parallax = false;
};

/// Builds a component from known rotations and bundle adjustment of all of its keyframes.
/// @return  nullopt where too few keyframes or points find a place, or the newest keyframe does
/// not.
std::optional<BuiltComponent> BuildComponent(const ComponentSources& sources,
                                             const Camera& camera,
                                             const KrotOptions& krot_options,
                                             const BundleOptions& bundle_options);

/// Median distance of the points from the camera that sees them; 0 where there are none.
double MedianDepth(const Reconstruction& map, FrameId frame);

}  // namespace rotslam
