#include "apps/mending.h"

#include <iterator>
#include <utility>

#include "apps/place_matches.h"

namespace rotslam {
namespace {

// A frame and those next to it.
std::set<FrameId> Around(FrameId frame, const CenterMap& frames) {
  constexpr int kAround = 2;
  std::set<FrameId> around;
  auto from = frames.find(frame);
  auto to = std::next(from);
  for (int k = 0; k < kAround && from != frames.begin(); ++k) --from;
  for (int k = 0; k < kAround && to != frames.end(); ++k) ++to;
  for (; from != to; ++from) around.insert(from->first);
  return around;
}

// Those that have moved, and those next to them.
std::set<FrameId> DoubtfulFrames(const RelocalisedMap& map) {
  std::set<FrameId> doubtful;
  for (const FrameId frame : map.moved) doubtful.merge(Around(frame, map.center_in_world));
  return doubtful;
}

// Describes the doubtful frames that are no places yet; whether there are any.
bool DescribeDoubtful(const RelocalisedMap& map, MendingSources& sources) {
  std::set<FrameId> frames = DoubtfulFrames(map);
  std::erase_if(frames, [&](FrameId frame) { return sources.places.contains(frame); });
  if (frames.empty() || !sources.describe) return false;
  Reconstruction poses;
  poses.cam_from_world = map.cam_from_world;
  poses.center_in_world = map.center_in_world;
  sources.places.merge(sources.describe(poses, frames));
  return true;
}

// Has the doubtful frames compared with what looks like those that have moved next to them; whether
// there is anything to compare.
bool CompareDoubtful(const RelocalisedMap& map, MendingSources& sources) {
  std::map<FrameId, std::set<FrameId>> matches;  // that stand, of frames that have moved
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

// For each frame that tracks see but no map holds, if it is a place, one that holds nothing else.
std::vector<Reconstruction> MapsOfLost(const std::vector<Track>& tracks,
                                       const std::map<FrameId, Features>& places,
                                       const RefinedComponents& refined) {
  std::set<FrameId> lost;
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

// The pairs, and the other way round where that may find a lost frame.
std::vector<Lookalike> BothWays(std::vector<Lookalike> pairs,
                                const std::vector<Reconstruction>& lost) {
  const std::size_t num_pairs = pairs.size();
  for (const Reconstruction& map : lost) {
    const FrameId frame = map.center_in_world.begin()->first;
    for (std::size_t k = 0; k < num_pairs; ++k) {
      if (pairs[k].match == frame) pairs.push_back({frame, pairs[k].frame});
    }
  }
  return pairs;
}

}  // namespace

std::set<FrameId> MendMaps(MendingSources sources,
                           const Camera& calibrated,
                           std::vector<Track> tracks,
                           const RelocalisationOptions& options,
                           std::uint64_t seed,
                           const BundleOptions& bundle_options,
                           RefinedComponents& refined) {
  // Where some stand right, others are seen to stand wrong.
  constexpr int kMaxPasses = 3;
  PlaceMatches places(sources.places, refined.camera);
  const auto relocalise = [&]() {
    const std::vector<Reconstruction> lost = MapsOfLost(tracks, sources.places, refined);
    std::vector<const Reconstruction*> maps;
    for (const BundleResult& bundle : refined.bundles) maps.push_back(&bundle.reconstruction);
    for (const Reconstruction& map : lost) maps.push_back(&map);
    return Relocalise(maps,
                      tracks,
                      places,
                      BothWays(sources.lookalikes, lost),
                      refined.camera,
                      options,
                      seed,
                      bundle_options.num_threads);
  };
  std::set<FrameId> moved;
  for (int pass = 0; pass < kMaxPasses; ++pass) {
    std::vector<RelocalisedMap> changed = relocalise();
    bool has_more = false;
    for (const RelocalisedMap& map : changed) {
      has_more |= DescribeDoubtful(map, sources);
      has_more |= CompareDoubtful(map, sources);
    }
    if (has_more) changed = relocalise();
    const std::set<FrameId> now = RefineRelocalised(
        changed, sources.held, calibrated, bundle_options, sources.complete, tracks, refined);
    if (now.empty()) break;
    moved.insert(now.begin(), now.end());
  }
  return moved;
}

}  // namespace rotslam
