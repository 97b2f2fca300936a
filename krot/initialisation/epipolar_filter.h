#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include "rotodom/types/maps.h"
#include "rotodom/types/track.h"

namespace rotslam {

/// Which observations fail the epipolar test, and which pairs of views make it.
struct EpipolarFilterOptions {
  double threshold_rad = 0.0057;  // angle between a ray and the epipolar plane; 4 px at f = 700
  int max_samples = 100;          // two-track samples per pair of views
  // Each view is tested against this many views that share the most tracks with it and come later.
  int partners_per_view = 3;
  int min_shared_tracks = 12;  // pairs with fewer say nothing
  std::uint64_t seed = 1;
};

/// An observation, as positions in the track list.
struct ObservationIndex {
  int track = 0;
  int observation = 0;
  auto operator<=>(const ObservationIndex&) const = default;
};

/// What the pairs of views say.
struct EpipolarVerdict {
  // Observations that contradict the known rotations: off the epipolar plane in more of the tested
  // pairs than on it.
  std::vector<ObservationIndex> outliers;
  // By view, what its rays and those of others miss common planes by, rad, as a robust standard
  // deviation: noise of two keypoints and errors of the rotations. Without views that have no pair
  // with a majority.
  std::map<FrameId, double> noise_rad;
};

/// Tests observations against the known rotations. The plane of a pair is spanned by a translation
/// direction drawn from two tracks and voted by all. Zero baseline is harmless: rays then coincide
/// and lie on every plane.
EpipolarVerdict TestEpipolarPlanes(const RotationMap& cam_from_world,
                                   const std::vector<Track>& tracks,
                                   const EpipolarFilterOptions& options);

}  // namespace rotslam
