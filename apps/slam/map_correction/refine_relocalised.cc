#include "apps/slam/map_correction/refine_relocalised.h"

#include <algorithm>
#include <iterator>
#include <map>
#include <utility>

namespace rotslam {
namespace {

// Adds observations to the tracks, where their frame has none yet.
std::vector<Track> WithObservations(
    const std::vector<std::pair<TrackId, Observation>>& observations, std::vector<Track> tracks) {
  std::map<TrackId, std::map<FrameId, Observation>> added;
  for (const auto& [track, observation] : observations) {
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

// The component of `parts` with the most observations.
int LargestOf(const std::set<int>& parts, const RefinedComponents& refined) {
  return *std::max_element(parts.begin(), parts.end(), [&](int a, int b) {
    return refined.bundles[a].summary.num_observations <
           refined.bundles[b].summary.num_observations;
  });
}

int NumExplained(const BundleSummary& summary) {
  return summary.num_observations + summary.support.num_observations;
}

// Whether the only change are new frames, and each of them has enough observations.
bool AddsFramesOnly(const RelocalisedMap& map,
                    const BundleResult& bundle,
                    const std::set<int>& parts,
                    const RefinedComponents& refined) {
  // The same as the default of RelocalisationOptions::min_inliers: more than wrong places explain
  // by chance.
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

// Whether the new map is better than the components it replaces. Where frames have moved it must
// explain more observations; those of the tracker count twice, those found later once. Where frames
// were only added the number may fall by two percent, since every bundle adjustment classifies some
// hundreds of observations differently.
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

// Adds the rounds, iterations and time of an adjustment to another summary.
void AddEffort(const BundleSummary& other, BundleSummary& summary) {
  summary.iterations += other.iterations;
  summary.seconds += other.seconds;
  summary.rounds.insert(summary.rounds.begin(), other.rounds.begin(), other.rounds.end());
}

}  // namespace

std::set<FrameId> RefineRelocalised(const std::vector<RelocalisedMap>& maps,
                                    const RelocalisedRefinement& refinement,
                                    std::vector<Track>& tracks,
                                    RefinedComponents& refined) {
  BundleOptions options = refinement.options;
  options.fixed_rotation.enabled = false;
  std::set<FrameId> moved;
  std::set<int> replaced;
  for (const RelocalisedMap& map : maps) {
    std::set<int> parts = map.parts;
    parts.erase(parts.lower_bound(static_cast<int>(refined.components.size())), parts.end());
    if (parts.empty()) continue;
    MapComponent component;
    for (const auto& [frame, center] : map.center_in_world) component.keyframes.insert(frame);
    // Wrong places bias the lens, so it starts from the calibration. With several maps it is kept
    // fixed, since all have the same lens.
    const bool is_all = parts.size() == refined.components.size();
    const Camera& camera = is_all ? refinement.calibrated : refined.camera;
    std::vector<Track> seen = WithBearingsOf(camera, WithObservations(map.observations, tracks));
    BundleResult bundle =
        RefineComponent(component,
                        {map.cam_from_world, map.center_in_world, seen, refinement.segments},
                        camera,
                        is_all ? options : WithFixedLens(options),
                        refinement.complete);
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
      bundle.summary.tangential_gain = before.tangential_gain;
      bundle.summary.lens_sigmas = before.lens_sigmas;
      bundle.summary.lens_covariance = before.lens_covariance;
    }
    // Components are ordered by their first keyframe.
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

}  // namespace rotslam
