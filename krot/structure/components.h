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
