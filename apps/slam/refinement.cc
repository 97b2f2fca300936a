#include "apps/slam/refinement.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <iterator>
#include <map>
#include <utility>

#include "rotodom/tracks/keyframes.h"

namespace rotslam {
namespace {

// Keyframes of each component of the known-rotation solution, by first keyframe.
std::vector<MapComponent> ComponentsOf(const KrotSolution& krot) {
  std::map<int, MapComponent> by_number;
  for (const auto& [frame, number] : krot.component) {
    if (krot.center_in_world.contains(frame)) by_number[number].keyframes.insert(frame);
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

// Bundle adjustment of one component, in its own scale, from poses of all its keyframes.
BundleResult RefineComponent(const MapComponent& component,
                             const RotationMap& cam_from_world,
                             const CenterMap& center_in_world,
                             const std::vector<Track>& tracks,
                             const std::vector<PureRotationSegment>& held,
                             const Camera& camera,
                             const BundleOptions& options,
                             const TrackCompletion& complete) {
  BundleProblem problem;
  problem.camera = camera;
  for (const FrameId frame : component.keyframes) {
    problem.start.cam_from_world[frame] = cam_from_world.at(frame);
    problem.start.center_in_world[frame] = center_in_world.at(frame);
  }
  for (const PureRotationSegment& stretch : held) {
    if (component.keyframes.contains(stretch.first) && component.keyframes.contains(stretch.last)) {
      problem.shared_center[stretch.last] = stretch.first;
    }
  }
  problem.start.tracks = RestrictTracks(tracks, component.keyframes, 2);
  return RefineBundle(problem, options, complete);
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

// The tracks with observations more, those of frames that they have already left out.
std::vector<Track> WithSightings(const std::vector<std::pair<TrackId, Observation>>& sightings,
                                 std::vector<Track> tracks) {
  std::map<TrackId, std::map<FrameId, Observation>> added;
  for (const auto& [track, observation] : sightings) {
    added[track].try_emplace(observation.frame, observation);
  }
  for (Track& track : tracks) {
    const auto more = added.find(track.id);
    if (more == added.end()) continue;
    for (const Observation& observation : track.observations) {
      more->second.insert_or_assign(observation.frame, observation);
    }
    track.observations.clear();
    for (const auto& [frame, observation] : more->second) track.observations.push_back(observation);
  }
  return tracks;
}

// Of those in `parts`, the one with the most observations.
int LargestOf(const std::set<int>& parts, const RefinedComponents& refined) {
  return *std::max_element(parts.begin(), parts.end(), [&](int a, int b) {
    return refined.bundles[a].summary.num_observations <
           refined.bundles[b].summary.num_observations;
  });
}

int NumExplained(const BundleSummary& summary) {
  return summary.num_observations + summary.support.num_observations;
}

// Whether none of the map's frames that had a place has another one now, and those that had none
// are seen well there.
bool AddsFramesOnly(const RelocalisedMap& map,
                    const BundleResult& bundle,
                    const std::set<int>& parts,
                    const RefinedComponents& refined) {
  // What relocalisation takes for no chance.
  constexpr int kLeastObservations = 30;
  std::map<FrameId, int> num_observations;
  for (const Track& track : bundle.reconstruction.tracks) {
    for (const Observation& observation : track.observations) {
      ++num_observations[observation.frame];
    }
  }
  return parts.size() == 1 && std::ranges::all_of(map.moved, [&](FrameId frame) {
           return !refined.components[*parts.begin()].keyframes.contains(frame) &&
                  num_observations[frame] >= kLeastObservations;
         });
}

// Whether the map that takes the parts' place is better: where frames have moved it explains more,
// of all that is seen now, and of what the tracker saw, so that what is found new counts once and
// what is lost twice. Where frames are but added the rest need only be as before; every adjustment
// takes and leaves some hundreds of other observations.
bool IsBetter(const RelocalisedMap& map,
              const BundleResult& bundle,
              const std::set<int>& parts,
              const RefinedComponents& refined) {
  constexpr double kAsBefore = 0.98;
  int num_explained = 0;
  for (const int part : parts) num_explained += NumExplained(refined.bundles[part].summary);
  if (!bundle.Usable()) return false;
  if (NumExplained(bundle.summary) > num_explained) return true;
  return NumExplained(bundle.summary) > kAsBefore * num_explained &&
         AddsFramesOnly(map, bundle, parts, refined);
}

BundleOptions WithLensHeld(BundleOptions options) {
  options.lens.refine_focal = options.lens.refine_distortion = false;
  options.lens.refine_principal_point = false;
  return options;
}

// What an adjustment took that led to the other one, or to nothing.
void AddEffort(const BundleSummary& other, BundleSummary& summary) {
  summary.iterations += other.iterations;
  summary.seconds += other.seconds;
  summary.rounds.insert(summary.rounds.begin(), other.rounds.begin(), other.rounds.end());
}

}  // namespace

std::vector<Track> WithBearingsOf(const Camera& camera, std::vector<Track> tracks) {
  for (Track& track : tracks) {
    for (Observation& observation : track.observations) {
      const auto bearing = camera.Unproject(observation.keypoint_px);
      if (bearing) observation.bearing = *bearing;
    }
  }
  return tracks;
}

RefinedComponents RefineComponents(const RotationMap& cam_from_world,
                                   const KrotSolution& krot,
                                   const std::vector<Track>& tracks,
                                   const std::vector<PureRotationSegment>& held,
                                   const Camera& camera,
                                   const BundleOptions& options,
                                   const TrackCompletion& complete) {
  RefinedComponents refined;
  refined.camera = camera;
  refined.components = ComponentsOf(krot);
  refined.bundles.resize(refined.components.size());
  if (refined.components.empty()) return refined;
  const auto refine =
      [&](std::size_t k, const std::vector<Track>& seen, const BundleOptions& bundle_options) {
        refined.bundles[k] = RefineComponent(refined.components[k],
                                             cam_from_world,
                                             krot.center_in_world,
                                             seen,
                                             held,
                                             refined.camera,
                                             bundle_options,
                                             complete);
      };
  const std::size_t first = LargestComponent(refined.components, tracks);
  refine(first, tracks, options);
  refined.camera = refined.bundles[first].camera;
  if (refined.components.size() == 1) return refined;
  const BundleOptions same_lens = WithLensHeld(options);
  const std::vector<Track> seen = WithBearingsOf(refined.camera, tracks);
  for (std::size_t k = 0; k < refined.components.size(); ++k) {
    if (k != first) refine(k, seen, same_lens);
  }
  return refined;
}

std::set<FrameId> RefineRelocalised(const std::vector<RelocalisedMap>& maps,
                                    const std::vector<PureRotationSegment>& held,
                                    const Camera& calibrated,
                                    BundleOptions options,
                                    const TrackCompletion& complete,
                                    std::vector<Track>& tracks,
                                    RefinedComponents& refined) {
  options.bridge.enabled = false;
  std::set<FrameId> moved;
  std::set<int> replaced;
  for (const RelocalisedMap& map : maps) {
    std::set<int> parts = map.parts;
    parts.erase(parts.lower_bound(static_cast<int>(refined.components.size())), parts.end());
    if (parts.empty()) continue;
    MapComponent component;
    for (const auto& [frame, center] : map.center_in_world) component.keyframes.insert(frame);
    // Where frames stood in a wrong place the lens made up for it. Several maps have one lens.
    const bool is_all = parts.size() == refined.components.size();
    const Camera& camera = is_all ? calibrated : refined.camera;
    std::vector<Track> seen = WithBearingsOf(camera, WithSightings(map.sightings, tracks));
    BundleResult bundle = RefineComponent(component,
                                          map.cam_from_world,
                                          map.center_in_world,
                                          seen,
                                          held,
                                          camera,
                                          is_all ? options : WithLensHeld(options),
                                          complete);
    BundleSummary& before = refined.bundles[LargestOf(parts, refined)].summary;
    if (!IsBetter(map, bundle, parts, refined)) {
      AddEffort(bundle.summary, before);
      continue;
    }
    moved.insert(map.moved.begin(), map.moved.end());
    tracks = std::move(seen);
    for (const int part : parts) AddEffort(refined.bundles[part].summary, bundle.summary);
    if (is_all) {
      refined.camera = bundle.camera;
    } else {
      bundle.summary.lens_gain = before.lens_gain;
      bundle.summary.lens_refined = before.lens_refined;
      bundle.summary.lens_sigmas = before.lens_sigmas;
    }
    // Components go by their first keyframe.
    const int first = *parts.begin();
    refined.bundles[first] = std::move(bundle);
    refined.components[first] = std::move(component);
    replaced.insert(std::next(parts.begin()), parts.end());
  }
  for (auto part = replaced.rbegin(); part != replaced.rend(); ++part) {
    refined.bundles.erase(refined.bundles.begin() + *part);
    refined.components.erase(refined.components.begin() + *part);
  }
  return moved;
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

std::string DescribeMeanError(const std::vector<BundleSummary>& bundles) {
  std::array<char, 48> text = {};
  std::snprintf(text.data(), text.size(), "mean error %.3g px", MeanErrorPx(bundles));
  return text.data();
}

std::string DescribeRounded(Camera camera) {
  const auto round = [](double& value) {
    std::array<char, 32> text = {};
    std::snprintf(text.data(), text.size(), "%.5g", value);
    value = std::strtod(text.data(), nullptr);
  };
  for (double* value : {&camera.fx, &camera.fy, &camera.cx, &camera.cy}) round(*value);
  for (double& coefficient : camera.distortion) round(coefficient);
  return Describe(camera);
}

}  // namespace rotslam
