#pragma once

#include <set>
#include <string>
#include <vector>

#include "apps/slam/relocalisation.h"
#include "ba/bundle_adjustment.h"
#include "krot/known_rotation.h"
#include "rotodom/types/pure_rotation_segment.h"

namespace rotslam {

/// Keyframes whose relative scale is known: they share tracks with depth.
struct MapComponent {
  std::set<FrameId> keyframes;
  bool placed_by_default = false;  // its scale and place rest on continuity, not on measurements
};

/// The components of a known-rotation solution, each refined in its own scale.
struct RefinedComponents {
  std::vector<MapComponent> components;  // of at least two views, by their first keyframe
  std::vector<BundleResult> bundles;     // one per component, not all of them usable
  Camera camera;                         // as the component with the most observations refined it
};

/// Bundle adjustment of every component from its known-rotation positions. The component with the
/// most observations refines the lens, as far as the options let it, and the others take it over.
/// @param cam_from_world  of every view that the solution has placed.
/// @param tracks          those that the solution was found from; all are judged anew.
/// @param held            segments without movement: where both ends are keyframes of a component
///                        they share a centre.
/// @param complete        as RefineBundle takes it.
RefinedComponents RefineComponents(const RotationMap& cam_from_world,
                                   const KrotSolution& krot,
                                   const std::vector<Track>& tracks,
                                   const std::vector<PureRotationSegment>& held,
                                   const Camera& camera,
                                   const BundleOptions& options,
                                   const TrackCompletion& complete = nullptr);

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

/// Mean reprojection error over the observations of all bundles; zero where there are none.
double MeanErrorPx(const std::vector<BundleSummary>& bundles);

/// "mean error 0.524 px", as MeanErrorPx gives it.
std::string DescribeMeanError(const std::vector<BundleSummary>& bundles);

/// The camera for a person to read: a refined lens is known to five digits at best.
std::string DescribeRounded(Camera camera);

/// The tracks with the bearings that `camera` gives their keypoints.
std::vector<Track> WithBearingsOf(const Camera& camera, std::vector<Track> tracks);

}  // namespace rotslam
