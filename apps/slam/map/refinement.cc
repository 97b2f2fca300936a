#include "apps/slam/map/refinement.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <iterator>
#include <map>
#include <utility>

#include "rotodom/types/track.h"

namespace rotslam {
namespace {

// Keyframes of each component that have a centre, by first keyframe.
std::vector<MapComponent> ComponentsOf(const std::map<FrameId, int>& component_of,
                                       const CenterMap& center_in_world) {
  std::map<int, MapComponent> by_number;
  for (const auto& [frame, number] : component_of) {
    if (center_in_world.contains(frame)) by_number[number].keyframes.insert(frame);
  }
  std::vector<MapComponent> components;
  for (auto& [number, component] : by_number) {
    if (component.keyframes.size() >= 2) components.push_back(std::move(component));
  }
  std::sort(components.begin(), components.end(), [](const MapComponent& a, const MapComponent& b) {
    return *a.keyframes.begin() < *b.keyframes.begin();
  });
  return components;
}

// Position of the component with the most observations.
std::size_t LargestComponent(const std::vector<MapComponent>& components,
                             const std::vector<Track>& tracks) {
  std::map<FrameId, int> count;
  for (const Track& track : tracks) {
    for (const Observation& observation : track.observations) ++count[observation.frame];
  }
  std::size_t largest = 0;
  int most = 0;
  for (std::size_t k = 0; k < components.size(); ++k) {
    int sum = 0;
    for (const FrameId frame : components[k].keyframes) sum += count[frame];
    if (sum <= most) continue;
    most = sum;
    largest = k;
  }
  return largest;
}

}  // namespace

BundleOptions WithFixedLens(BundleOptions options) {
  options.lens.refine_focal = options.lens.refine_distortion = false;
  options.lens.refine_principal_point = options.lens.refine_higher_terms = false;
  options.lens.given_sigmas.reset();
  return options;
}

BundleResult RefineComponent(const MapComponent& component,
                             const RefinementStart& start,
                             const Camera& camera,
                             const BundleOptions& options,
                             const TrackCompletion& complete) {
  BundleProblem problem;
  problem.camera = camera;
  for (const FrameId frame : component.keyframes) {
    problem.start.cam_from_world[frame] = start.cam_from_world.at(frame);
    problem.start.center_in_world[frame] = start.center_in_world.at(frame);
    const auto sigma_rad = start.rotation_sigma_rad.find(frame);
    if (sigma_rad != start.rotation_sigma_rad.end()) problem.rotation_sigma_rad.insert(*sigma_rad);
  }
  for (const PureRotationSegment& segment : start.segments) {
    if (component.keyframes.contains(segment.first) && component.keyframes.contains(segment.last)) {
      problem.shared_center[segment.last] = segment.first;
    }
  }
  problem.start.tracks = RestrictTracks(start.tracks, component.keyframes, 2);
  return RefineBundle(problem, options, complete);
}

std::vector<Track> WithBearingsOf(const Camera& camera, std::vector<Track> tracks) {
  for (Track& track : tracks) {
    for (Observation& observation : track.observations) {
      const auto bearing = camera.Unproject(observation.keypoint_px);
      if (bearing) observation.bearing = *bearing;
    }
  }
  return tracks;
}

RefinedComponents RefineComponents(const RefinementStart& start,
                                   const std::map<FrameId, int>& component,
                                   const Camera& camera,
                                   const BundleOptions& options,
                                   const TrackCompletion& complete) {
  RefinedComponents refined;
  refined.camera = camera;
  refined.components = ComponentsOf(component, start.center_in_world);
  refined.bundles.resize(refined.components.size());
  if (refined.components.empty()) return refined;
  const auto refine =
      [&](std::size_t k, const std::vector<Track>& seen, const BundleOptions& bundle_options) {
        refined.bundles[k] = RefineComponent(refined.components[k],
                                             {start.cam_from_world,
                                              start.center_in_world,
                                              seen,
                                              start.segments,
                                              start.rotation_sigma_rad},
                                             refined.camera,
                                             bundle_options,
                                             complete);
      };
  const std::size_t first = LargestComponent(refined.components, start.tracks);
  refine(first, start.tracks, options);
  refined.camera = refined.bundles[first].camera;
  if (refined.components.size() == 1) return refined;
  const BundleOptions same_lens = WithFixedLens(options);
  const std::vector<Track> seen = WithBearingsOf(refined.camera, start.tracks);
  for (std::size_t k = 0; k < refined.components.size(); ++k) {
    if (k != first) refine(k, seen, same_lens);
  }
  return refined;
}

MapBracket BracketComponents(const RefinedComponents& refined, const KrotOptions& options) {
  MapBracket all;
  all.status = BisectionStatus::kConverged;
  for (const BundleResult& bundle : refined.bundles) {
    if (!bundle.Usable()) continue;
    const MapBracket one = BracketMap(bundle.reconstruction, bundle.camera, options);
    if (one.status != BisectionStatus::kConverged) all.status = one.status;
    all.largest_residual = std::max(all.largest_residual, one.largest_residual);
    all.gamma_low = std::max(all.gamma_low, one.gamma_low);
    all.gamma_high = std::max(all.gamma_high, one.gamma_high);
    all.num_observations += one.num_observations;
    all.num_tracks += one.num_tracks;
    all.num_programs += one.num_programs;
    all.seconds += one.seconds;
  }
  return all;
}

double MeanErrorPx(const std::vector<BundleSummary>& bundles) {
  std::int64_t observations = 0;
  double sum_px = 0.0;
  for (const BundleSummary& bundle : bundles) {
    observations += bundle.num_observations;
    sum_px += bundle.after.mean_px * bundle.num_observations;
  }
  return observations == 0 ? 0.0 : sum_px / static_cast<double>(observations);
}

}  // namespace rotslam
