#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include "rotodom/types/maps.h"
#include "rotodom/types/track.h"

namespace rotslam {

/// The epipolar test of observations, and the pairs of views that it uses.
struct EpipolarFilterOptions {
  double threshold_rad = 0.0057;  // angle between a ray and the epipolar plane; 4 px at f = 700
  int max_samples = 100;          // two-track samples per pair of views
  // Each view is tested against this many views that share the most tracks with it and come later.
  int partners_per_view = 3;
  int min_shared_tracks = 12;  // pairs with fewer say nothing
  std::uint64_t seed = 1;
};

/// The result of the epipolar test.
struct EpipolarVerdict {
  // Observations that contradict the known rotations: they fail the test in more pairs than they
  // pass.
  std::vector<ObservationIndex> outliers;
  // By view, robust standard deviation of the angles between its rays and the epipolar planes, rad.
  // It includes the noise of two keypoints and errors of the rotations. Views without a pair in
  // which most tracks agree are missing.
  std::map<FrameId, double> noise_rad;
};

/// Tests observations against the known rotations. For each pair of views a translation direction
/// is sampled from two tracks and scored by all; it defines the epipolar planes. A zero baseline
/// does no harm: rays then coincide and lie in every plane.
EpipolarVerdict TestEpipolarPlanes(const RotationMap& cam_from_world,
                                   const std::vector<Track>& tracks,
                                   const EpipolarFilterOptions& options);

}  // namespace rotslam
