#pragma once

#include <map>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "ba/bundle_adjustment.h"
#include "krot/known_rotation.h"
#include "krot/map_bracket.h"
#include "rotodom/types/pure_rotation_segment.h"

namespace rotslam {

/// Keyframes whose relative scale is known: they share tracks with depth.
struct MapComponent {
  std::set<FrameId> keyframes;
  bool placed_by_default = false;  // scale and place are assumed by continuity, not measured
};

/// The components of a known-rotation solution, each refined in its own scale.
struct RefinedComponents {
  std::vector<MapComponent> components;  // of at least two views, by their first keyframe
  std::vector<BundleResult> bundles;     // one per component, not all of them usable
  Camera camera;                         // as the component with the most observations refined it
};

/// Start values for the bundle adjustment of components.
struct RefinementStart {
  const RotationMap& cam_from_world;
  const CenterMap& center_in_world;
  const std::vector<Track>& tracks;  // outliers among their observations are classified anew
  // The two keyframes at the ends of a segment share a centre if they are in one component.
  std::span<const PureRotationSegment> segments = {};
  // Deviations of the rotations where they are measurements of a sensor.
  std::map<FrameId, double> rotation_sigma_rad = {};
};

/// Bundle adjustment of one component, in its own scale, from poses of all its keyframes.
BundleResult RefineComponent(const MapComponent& component,
                             const RefinementStart& start,
                             const Camera& camera,
                             const BundleOptions& options,
                             const TrackCompletion& complete);

/// The options with the lens fixed.
BundleOptions WithFixedLens(BundleOptions options);

/// Bundle adjustment of every component from its known-rotation positions. The component with the
/// most observations refines the lens, as far as the options let it; the others use that lens.
/// @param start      the rotations and tracks of the known-rotation problem, the centres of its
///                   solution.
/// @param component  as in KrotSolution.
/// @param complete   as RefineBundle takes it.
RefinedComponents RefineComponents(const RefinementStart& start,
                                   const std::map<FrameId, int>& component,
                                   const Camera& camera,
                                   const BundleOptions& options,
                                   const TrackCompletion& complete = nullptr);

/// BracketMap of every usable component, taken together: the least possible largest residual over
/// all of them, and their own.
/// @param options  of the known-rotation problem.
MapBracket BracketComponents(const RefinedComponents& refined, const KrotOptions& options);

/// Mean reprojection error over the observations of all bundles; zero where there are none.
double MeanErrorPx(const std::vector<BundleSummary>& bundles);

/// The tracks with the bearings that `camera` gives their keypoints.
std::vector<Track> WithBearingsOf(const Camera& camera, std::vector<Track> tracks);

}  // namespace rotslam
