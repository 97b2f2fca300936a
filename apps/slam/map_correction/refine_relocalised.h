#pragma once

#include <set>
#include <vector>

#include "apps/slam/map/refinement.h"
#include "apps/slam/map_correction/relocalisation.h"

namespace rotslam {

/// Inputs that all bundle adjustments of relocalised maps share.
struct RelocalisedRefinement {
  Camera calibrated;  // as it was given
  BundleOptions options = {};
  TrackCompletion complete = nullptr;                  // as RefineBundle takes it
  std::span<const PureRotationSegment> segments = {};  // as RefineComponents takes them
};

/// Adjusts the maps that Relocalise has changed. A map of all keyframes refines the lens, the
/// others keep it fixed. A map that explains more observations than the components it was made of
/// replaces them. Rounds, iterations and seconds of the summaries include those of the replaced
/// components, or of the rejected map.
/// @param maps     indices of parts beyond the components denote frames that had no place.
/// @param tracks   the input of Relocalise; receive the observations of the accepted maps.
/// @param refined  what Relocalise was given.
/// @return  the keyframes that were moved.
std::set<FrameId> RefineRelocalised(const std::vector<RelocalisedMap>& maps,
                                    const RelocalisedRefinement& refinement,
                                    std::vector<Track>& tracks,
                                    RefinedComponents& refined);

}  // namespace rotslam
