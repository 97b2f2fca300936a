#include "apps/slam/live/component_builder.h"

#include <set>
#include <utility>

#include "apps/slam/map/refinement.h"
#include "krot/known_rotation.h"
#include "rotodom/types/median.h"
#include "rotodom/types/triangulation.h"

namespace rotslam {
namespace {

// A component has at least so many keyframes, the newest among them, and so many points.
constexpr int kMinKeyframes = 3;
constexpr int kMinPoints = 50;
// Half of the points are seen under this angle where the parallax suffices.
constexpr double kMinParallax = 3.0 * kRadFromDeg;

// Median over the points of the largest angle between two of their rays, rad.
double MedianParallax(const Reconstruction& map) {
  std::vector<double> angles;
  for (const Track& track : map.tracks) {
    std::vector<PosedRay> rays;
    rays.reserve(track.observations.size());
    for (const Observation& observation : track.observations) {
      rays.push_back({map.cam_from_world.at(observation.frame),
                      map.center_in_world.at(observation.frame),
                      observation.bearing});
    }
    angles.push_back(TriangulationAngle(rays, map.point_in_world.at(track.id)));
  }
  return Median(std::move(angles));
}

}  // namespace

std::optional<BuiltComponent> BuildComponent(const ComponentSources& sources,
                                             const Camera& camera,
                                             const KrotOptions& krot_options,
                                             const BundleOptions& bundle_options) {
  std::set<FrameId> frames;
  for (const auto& [frame, rotation] : sources.cam_from_world) frames.insert(frame);
  const auto is_enough = [&](const std::set<FrameId>& placed) {
    return std::ssize(placed) >= kMinKeyframes && placed.contains(*frames.rbegin());
  };
  if (std::ssize(frames) < kMinKeyframes) return std::nullopt;
  const std::vector<Track> tracks = RestrictTracks(sources.tracks, frames, kMinTrackObservations);
  const KrotSolution solution =
      SolveKnownRotation(sources.cam_from_world, tracks, camera, krot_options, sources.sigma_rad);
  if (!solution.Usable() || solution.status == KrotStatus::kContradiction) return std::nullopt;
  MapComponent component;
  for (const auto& [frame, number] : solution.component) {
    if (number == 0) component.keyframes.insert(frame);
  }
  if (!is_enough(component.keyframes)) return std::nullopt;
  BundleResult refined = RefineComponent(component,
                                         {sources.cam_from_world, solution.center_in_world, tracks},
                                         camera,
                                         bundle_options,
                                         nullptr);
  if (!refined.Usable()) return std::nullopt;
  BuiltComponent built;
  built.map = std::move(refined.reconstruction);
  std::set<FrameId> placed;
  for (const auto& [frame, center] : built.map.center_in_world) placed.insert(frame);
  if (!is_enough(placed) || std::ssize(built.map.point_in_world) < kMinPoints) return std::nullopt;
  built.has_parallax = MedianParallax(built.map) >= kMinParallax;
  return built;
}

double MedianDepth(const Reconstruction& map, FrameId frame) {
  const auto center = map.center_in_world.find(frame);
  if (center == map.center_in_world.end()) return 0.0;
  std::vector<double> depths;
  for (const Track& track : map.tracks) {
    const auto point = map.point_in_world.find(track.id);
    if (point == map.point_in_world.end()) continue;
    for (const Observation& observation : track.observations) {
      if (observation.frame != frame) continue;
      depths.push_back((point->second - center->second).norm());
    }
  }
  return Median(std::move(depths));
}

}  // namespace rotslam
