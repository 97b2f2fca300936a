#pragma once

#include <set>
#include <vector>

#include "apps/slam/map/refinement.h"
#include "apps/slam/map_correction/relocalisation.h"

namespace rotslam {

/// Bundle adjustment once more of the maps that Relocalise has changed; of one that is all there is
/// with the lens, and else with the lens as it is. Those that explain more of the images then
/// replace the components that they were made of. Their rounds, iterations and seconds count those
/// of these components, too, and where a map is refused the component counts the map's.
/// @param maps        parts beyond the components are those of frames that had no place.
/// @param calibrated  the camera as it was given.
/// @param tracks      as Relocalise took them; get the sightings of the maps that are kept.
/// @param refined     what Relocalise was given.
/// @return  the keyframes that stand elsewhere now.
std::set<FrameId> RefineRelocalised(const std::vector<RelocalisedMap>& maps,
                                    const std::vector<PureRotationSegment>& held,
                                    const Camera& calibrated,
                                    BundleOptions options,
                                    const TrackCompletion& complete,
                                    std::vector<Track>& tracks,
                                    RefinedComponents& refined);

}  // namespace rotslam
