#pragma once

#include <map>
#include <vector>

#include "rotodom/types/maps.h"
#include "rotodom/types/track.h"

namespace rotslam {

/// A view belongs to a component when it sees at least this many points known to it. Three
/// determine a position with one to spare; more guard against chance.
inline constexpr int kMinSharedPoints = 8;

/// When views count as tied to each other.
struct ComponentOptions {
  // A track is a known point once two of the component's views see it under this parallax. Under
  // less, but more than noise makes, it counts by the square of its share of it: what many points
  // tell of the scale goes with the sum of their squared parallaxes.
  double min_parallax_rad = 0.0;
  // By view, what parallax is without a baseline, rad, as a standard deviation: noise and errors of
  // the rotations. Of views without, no track under min_parallax_rad counts.
  std::map<FrameId, double> noise_rad;
  // More than noise is what is beyond so many of the noisier view's standard deviations.
  double min_noise_ratio = 4.0;
};

/// Views whose relative positions are determined up to one common scale and translation.
struct ViewComponent {
  std::vector<FrameId> views;  // each can be registered from the ones before it
};

/// Finds rigid components: starting from a pair of views, adds every view that sees enough known
/// points, the nearest in time first. The condition is sufficient, not necessary: components are
/// rigid, though larger ones may exist. Remaining views are in no component.
/// @param tracks  with frames in `cam_from_world` and finite bearings.
std::vector<ViewComponent> FindComponents(const RotationMap& cam_from_world,
                                          const std::vector<Track>& tracks,
                                          const ComponentOptions& options);

/// Largest angle between a track's first ray and any later one in world axes, rad. It contains
/// parallax, noise and rotation errors, but not the rotation itself.
double TrackParallax(const RotationMap& cam_from_world, const Track& track);

}  // namespace rotslam
