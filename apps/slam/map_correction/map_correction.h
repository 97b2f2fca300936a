#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <set>
#include <vector>

#include "apps/slam/map/refinement.h"
#include "apps/slam/map_correction/relocalisation.h"
#include "ba/bundle_adjustment.h"
#include "rotodom/features/features.h"
#include "rotodom/types/pure_rotation_segment.h"

namespace rotslam {

/// Detects and describes corners of frames of a map, at their positions in a global-shutter image.
/// Frames whose images cannot be read are missing in the result.
using FrameDescription = std::function<std::map<FrameId, Features>(
    const Reconstruction& map, const std::set<FrameId>& frames)>;

/// Evidence that frames are in a wrong place, and what the correction needs beside the maps.
struct MapCorrectionSources {
  Camera calibrated;          // as it was given
  std::vector<Track> tracks;  // as RefineComponents took them
  std::vector<Lookalike> lookalikes;
  std::map<FrameId, Features> places;  // described corners of those frames and some around them
  std::set<FrameId> unregistered;      // frames whose tracks do not place them in a map
  FrameDescription describe;           // for frames not in `places`; may be null
  TrackCompletion complete;            // as RefineBundle takes it
  std::vector<PureRotationSegment> segments;  // as RefineComponents takes them
  std::uint64_t seed = 1;
};

/// Moves keyframes that Relocalise finds in a wrong place, and adjusts the maps from there, as long
/// as the maps explain more observations that way. Neighbours of a moved keyframe are tested as
/// well, since the same wrong matches may have misled them. Places that no map holds, and maps that
/// are not connected to the others, are found in the same way.
/// @param refined  the maps; those that are corrected are replaced.
/// @return  the keyframes that were moved; the same at any number of threads.
/// Error:   see docs/measurements.md.
/// Cost:    Relocalise's, and a bundle adjustment for each of up to three passes.
std::set<FrameId> CorrectMaps(MapCorrectionSources sources,
                              const RelocalisationOptions& options,
                              const BundleOptions& bundle_options,
                              RefinedComponents& refined);

}  // namespace rotslam
