#include "apps/slam/map_correction/map_correction.h"

#include <iterator>
#include <utility>

#include "apps/slam/map_correction/place_matches.h"
#include "apps/slam/map_correction/refine_relocalised.h"

namespace rotslam {
namespace {

// A frame and the two frames of the map on each side of it.
template <class Value>
std::set<FrameId> Around(FrameId frame, const std::map<FrameId, Value>& frames) {
  constexpr int kAround = 2;
  std::set<FrameId> around;
  auto from = frames.lower_bound(frame);
  auto to = frames.upper_bound(frame);
  for (int k = 0; k < kAround && from != frames.begin(); ++k) --from;
  for (int k = 0; k < kAround && to != frames.end(); ++k) ++to;
  for (; from != to; ++from) around.insert(from->first);
  return around;
}

// Frames that have moved, and their neighbours, which may be displaced as well.
std::set<FrameId> FramesToCheck(const RelocalisedMap& map) {
  std::set<FrameId> to_check;
  for (const FrameId frame : map.moved) to_check.merge(Around(frame, map.center_in_world));
  return to_check;
}

// Describes the frames to check that are no places yet. Returns whether there are any.
bool DescribeFramesToCheck(const RelocalisedMap& map, MapCorrectionSources& sources) {
  std::set<FrameId> frames = FramesToCheck(map);
  std::erase_if(frames, [&](FrameId frame) { return sources.places.contains(frame); });
  if (frames.empty() || !sources.describe) return false;
  Reconstruction poses;
  poses.cam_from_world = map.cam_from_world;
  poses.center_in_world = map.center_in_world;
  sources.places.merge(sources.describe(poses, frames));
  return true;
}

// Adds pairs of the frames to check and the frames similar to the moved ones. Returns whether there
// are any.
bool CompareFramesToCheck(const RelocalisedMap& map, MapCorrectionSources& sources) {
  std::map<FrameId, std::set<FrameId>> matches;  // frames that stay, by moved frame
  for (const auto& [frame, match] : sources.lookalikes) {
    if (map.moved.contains(frame) && !map.moved.contains(match)) matches[frame].insert(match);
    if (map.moved.contains(match) && !map.moved.contains(frame)) matches[match].insert(frame);
  }
  std::set<std::pair<FrameId, FrameId>> pairs;
  for (const auto& [moved, alike] : matches) {
    for (const FrameId frame : Around(moved, map.center_in_world)) {
      for (const FrameId match : alike) {
        if (frame != match) pairs.emplace(frame, match);
      }
    }
  }
  for (const auto& [frame, match] : sources.lookalikes) pairs.erase({frame, match});
  for (const auto& [frame, match] : pairs) sources.lookalikes.push_back({frame, match});
  return !pairs.empty();
}

// A map of its own for each place that tracks see, or that is unregistered, and that no map holds.
std::vector<Reconstruction> MapsOfUnregistered(const std::vector<Track>& tracks,
                                               const std::set<FrameId>& unregistered,
                                               const std::map<FrameId, Features>& places,
                                               const RefinedComponents& refined) {
  std::set<FrameId> lost = unregistered;
  for (const Track& track : tracks) {
    for (const Observation& observation : track.observations) lost.insert(observation.frame);
  }
  for (const BundleResult& bundle : refined.bundles) {
    for (const auto& [frame, center] : bundle.reconstruction.center_in_world) lost.erase(frame);
  }
  std::vector<Reconstruction> maps;
  for (const FrameId frame : lost) {
    if (!places.contains(frame)) continue;
    Reconstruction& map = maps.emplace_back();
    map.cam_from_world[frame] = Rotation();
    map.center_in_world[frame] = Eigen::Vector3d::Zero();
  }
  return maps;
}

// The given pairs and those that may connect two maps in addition: the reversed ones, and each
// place with the places before and after it.
std::vector<Lookalike> PairsAcross(const std::vector<const Reconstruction*>& maps,
                                   const std::map<FrameId, Features>& places,
                                   std::vector<Lookalike> pairs) {
  std::map<FrameId, const Reconstruction*> map_of;
  for (const Reconstruction* map : maps) {
    for (const auto& [frame, center] : map->center_in_world) map_of[frame] = map;
  }
  // Whether the two frames are in different maps, and the match's map has points.
  const auto is_across = [&](FrameId frame, FrameId match) {
    const auto from = map_of.find(frame);
    const auto to = map_of.find(match);
    return from != map_of.end() && to != map_of.end() && from->second != to->second &&
           !to->second->point_in_world.empty();
  };
  const std::size_t num_pairs = pairs.size();
  for (std::size_t k = 0; k < num_pairs; ++k) {
    const auto [frame, match] = pairs[k];
    if (is_across(match, frame)) pairs.push_back({match, frame});
  }
  for (const auto& [frame, map] : map_of) {
    for (const FrameId other : Around(frame, places)) {
      if (is_across(frame, other)) pairs.push_back({frame, other});
    }
  }
  return pairs;
}

}  // namespace

std::set<FrameId> CorrectMaps(MapCorrectionSources sources,
                              const RelocalisationOptions& options,
                              const BundleOptions& bundle_options,
                              RefinedComponents& refined) {
  // Further frames are found displaced once others have been corrected. The number of passes bounds
  // the time.
  constexpr int kMaxPasses = 3;
  const RelocalisedRefinement refinement{
      sources.calibrated, bundle_options, sources.complete, sources.segments};
  PlaceMatches places(sources.places, refined.camera);
  const auto relocalise = [&]() {
    const std::vector<Reconstruction> lost =
        MapsOfUnregistered(sources.tracks, sources.unregistered, sources.places, refined);
    std::vector<const Reconstruction*> maps;
    for (const BundleResult& bundle : refined.bundles) maps.push_back(&bundle.reconstruction);
    for (const Reconstruction& map : lost) maps.push_back(&map);
    return Relocalise({maps,
                       sources.tracks,
                       PairsAcross(maps, sources.places, sources.lookalikes),
                       refined.camera},
                      options,
                      sources.seed,
                      bundle_options.num_threads,
                      places);
  };
  std::set<FrameId> moved;
  for (int pass = 0; pass < kMaxPasses; ++pass) {
    std::vector<RelocalisedMap> changed = relocalise();
    bool has_more = false;
    for (const RelocalisedMap& map : changed) {
      has_more |= DescribeFramesToCheck(map, sources);
      has_more |= CompareFramesToCheck(map, sources);
    }
    if (has_more) changed = relocalise();
    const std::set<FrameId> now = RefineRelocalised(changed, refinement, sources.tracks, refined);
    if (now.empty()) break;
    moved.insert(now.begin(), now.end());
  }
  return moved;
}

}  // namespace rotslam
