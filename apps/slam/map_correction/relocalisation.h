#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <vector>

#include "apps/slam/map_correction/lookalike.h"
#include "apps/slam/map_correction/place_matches.h"
#include "apps/slam/map_correction/relocalisation_options.h"
#include "rotodom/camera/camera.h"
#include "rotodom/types/reconstruction.h"

namespace rotslam {

/// A map with corrected poses. It may replace several maps.
struct RelocalisedMap {
  std::set<int> parts;  // indices of the maps that it replaces
  // Of all their frames.
  RotationMap cam_from_world;
  CenterMap center_in_world;
  // Observations of known points that it rests on.
  std::vector<std::pair<TrackId, Observation>> observations;
  std::set<FrameId> moved;  // frames whose place differs from that in the largest of the parts
};

/// Maps, and frames that look alike.
struct RelocalisationInputs {
  const std::vector<const Reconstruction*>& maps;  // each in its own world; no frame in two of them
  // With the ids of the maps' points, and all observations, whether they fit or not.
  const std::vector<Track>& tracks;
  const std::vector<Lookalike>& lookalikes;
  const Camera& camera;
};

/// Finds frames that are in a wrong place of the map.
///
/// For each pair of similar frames, the pose of one is estimated anew from the points that the
/// other one and its neighbours see, by matching descriptors and independent of the present poses.
/// Every frame is tested against the points of its own tracks as well. Where a found pose
/// contradicts the present one, the frame of the pair against which more evidence speaks is moved.
/// Frames that share more points with the moved ones than with the rest move with them. Maps that
/// see the same points are merged. The results are start values; bundle adjustment decides whether
/// they are better.
/// @param places  pass the same object to later calls, which use its matches again.
/// @return  the maps that change; the same at any `num_threads`. Throws std::invalid_argument when
/// an option is out of range.
/// Error:   to a few hundredths of the distance to the points (relocalisation tests).
/// Cost:    20 ms for each pair, 100 ms where neighbours are needed.
/// Source:  Mur-Artal and Tardos, ORB-SLAM2, 2017, sec. III-E, for the relocalisation of a single
///          frame. The choice of the frame that moves is ours.
std::vector<RelocalisedMap> Relocalise(const RelocalisationInputs& inputs,
                                       const RelocalisationOptions& options,
                                       std::uint64_t seed,
                                       int num_threads,
                                       PlaceMatches& places);

}  // namespace rotslam
