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

/// Described corners of some frames of a map, where a global shutter would see them; fewer where
/// images cannot be had.
using FrameDescription = std::function<std::map<FrameId, Features>(
    const Reconstruction& map, const std::set<FrameId>& frames)>;

/// What says that frames stand in a wrong place.
struct MapCorrectionSources {
  std::vector<Lookalike> lookalikes;
  std::map<FrameId, Features> places;     // described corners of those and of some around them
  std::set<FrameId> apart;                // frames whose tracks do not place them in a map
  FrameDescription describe;              // for frames that are no places; may be null
  TrackCompletion complete;               // as RefineBundle takes it
  std::vector<PureRotationSegment> held;  // as RefineComponents takes them
};

/// Moves keyframes to where others that look alike say that they are (see Relocalise), and adjusts
/// the maps from there, as long as that makes them explain more. Keyframes next to those that move
/// are looked at, too: what led the ones astray may mislead the others. Places that no map holds,
/// and maps apart from the others, are found in the same way, by what looks alike and by what comes
/// before and behind them.
/// @param calibrated  the camera as it was given.
/// @param tracks      as RefineComponents took them.
/// @param refined     the maps; those that are corrected are replaced.
/// @return  the keyframes that stand elsewhere now; the same at any number of threads.
/// Error:   from three starts EuRoC's keyframes end in the same places to 2 mm with seven seeds of
/// eight, see docs/method.md.
/// Cost:    Relocalise's, and a bundle adjustment for each of up to three passes.
std::set<FrameId> CorrectMaps(MapCorrectionSources sources,
                              const Camera& calibrated,
                              std::vector<Track> tracks,
                              const RelocalisationOptions& options,
                              std::uint64_t seed,
                              const BundleOptions& bundle_options,
                              RefinedComponents& refined);

}  // namespace rotslam
