#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "apps/slam/live/growing_map.h"
#include "apps/slam/live/keyframe_chain.h"
#include "apps/slam/live/mapper_input.h"

namespace rotslam {

/// The map in which revisited places are looked for.
struct PlaceLinkSources {
  const GrowingMap& map;
  const KeyframeChain& chain;         // of `map`
  const RotationMap& cam_from_world;  // of the chain, as the closed loops have it
  double focal_px = 0.0;
  std::uint64_t seed = 0;
};

/// A link, and the points that agree with it.
struct VerifiedPlaceLink {
  PlaceLink link;
  std::vector<const RevisitedPoint*> points;  // of the RevisitedPlace
};

/// Finds where the newer keyframe of a revisited place is, by resection from the points of the
/// older place; its orientation is known. The scale is the median ratio of the points' distances.
/// @return  nullopt where too few points agree.
std::optional<VerifiedPlaceLink> FindPlaceLink(const RevisitedPlace& place,
                                               const PlaceLinkSources& sources);

/// Whether a chain differs so much from new orientations of its keyframes, or from links, that it
/// has to move.
/// @param depth  median depth of the points that the newest keyframe sees.
bool Contradicts(const KeyframeChain& chain,
                 const RotationMap& cam_from_world,
                 const std::vector<PlaceLink>& links,
                 double depth);

}  // namespace rotslam
