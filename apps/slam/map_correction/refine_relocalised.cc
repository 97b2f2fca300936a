#include "apps/slam/map_correction/refine_relocalised.h"

#include <algorithm>
#include <iterator>
#include <map>
#include <utility>

namespace rotslam {
namespace {

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

// What an adjustment took that led to the other one, or to nothing.
void AddEffort(const BundleSummary& other, BundleSummary& summary) {
  summary.iterations += other.iterations;
  summary.seconds += other.seconds;
  summary.rounds.insert(summary.rounds.begin(), other.rounds.begin(), other.rounds.end());
}

}  // namespace

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

}  // namespace rotslam
