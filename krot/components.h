#pragma once

#include <vector>

#include "rotodom/types/maps.h"
#include "rotodom/types/track.h"

namespace rotslam {

/// When views count as tied to each other.
struct ComponentOptions {
  // A view joins when it sees at least this many points known to the component. Three determine a
  // position with one to spare; more guard against chance.
  int min_shared_points = 8;
  // A track is a known point once two of the component's views see it under this parallax.
  double min_parallax_rad = 0.0;
};

/// Views whose positions hang together rigidly: one scale, one translation.
struct ViewComponent {
  std::vector<FrameId> views;  // in an order in which each can be placed from the ones before
};

/// Grows rigid components: a pair of views, then every view that sees enough points already known,
/// nearest in time first. A sufficient condition: what is joined is rigid, though more may be.
/// Views left over stand in no component.
/// @param tracks  frames all in `cam_from_world`, bearings finite.
std::vector<ViewComponent> FindComponents(const RotationMap& cam_from_world,
                                          const std::vector<Track>& tracks,
                                          const ComponentOptions& options);

/// Largest angle between a track's first world-frame ray and any later one, rad: parallax with the
/// rotation taken out, noise and rotation error left in.
double TrackParallax(const RotationMap& cam_from_world, const Track& track);

}  // namespace rotslam
