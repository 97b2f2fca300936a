#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "apps/slam/map_correction/place_matches.h"
#include "rotodom/camera/camera.h"
#include "rotodom/types/reconstruction.h"

namespace rotslam {

/// Of finding frames again that a map holds in a wrong place, or that only another map holds.
struct RelocalisationOptions {
  bool enabled = true;
  // Corners that a pose must explain. Of wrong places chance explains up to 12 (EuRoC).
  int min_inliers = 30;

  std::optional<std::string> Problem() const;

  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("enabled", enabled);
    visit("min_inliers", min_inliers);
  }
};

/// Two frames that look alike.
struct Lookalike {
  FrameId frame;
  FrameId match;
};

/// A map with other poses, or one in the place of several.
struct RelocalisedMap {
  std::set<int> parts;  // the maps that it takes the place of
  // Of all their frames.
  RotationMap cam_from_world;
  CenterMap center_in_world;
  // Observations of known points that it rests on.
  std::vector<std::pair<TrackId, Observation>> sightings;
  std::set<FrameId> moved;  // those that stand elsewhere than in the largest of the parts
};

/// Finds frames that stand in a wrong place. Of two frames that look alike, one is placed anew
/// against the points that the other one and its neighbours see, by their descriptors, whatever
/// the present poses are; and every frame against the points that its own tracks show. Where what
/// is found contradicts a present pose, one of the two frames moves: the one of which most of what
/// is known speaks against it. With it move the frames that share more points with those that move
/// than with the rest. Maps that see the same become one. What comes out are starts: bundle
/// adjustment has to say whether they are better.
/// @param maps    each in its own world; no frame in two of them.
/// @param tracks  with the ids of the maps' points, and all observations, whether they fit or not.
/// @param places  to be given again where Relocalise is asked again.
/// @return  the maps that change; the same at any `num_threads`. Throws std::invalid_argument when
/// an option is out of range.
/// Error:   to a few hundredths of the distance to the points (relocalisation tests).
/// Cost:    20 ms for each pair that looks alike, 100 ms for one that has to ask neighbours.
/// Source:  as Mur-Artal and Tardos, ORB-SLAM2, 2017, sec. III-E, relocalise a lost camera; whom to
/// believe is ours.
std::vector<RelocalisedMap> Relocalise(const std::vector<const Reconstruction*>& maps,
                                       const std::vector<Track>& tracks,
                                       PlaceMatches& places,
                                       const std::vector<Lookalike>& lookalikes,
                                       const Camera& camera,
                                       const RelocalisationOptions& options,
                                       std::uint64_t seed,
                                       int num_threads);

}  // namespace rotslam
