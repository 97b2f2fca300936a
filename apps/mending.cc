#include "apps/mending.h"

#include <iterator>
#include <utility>

#include "apps/place_matches.h"

namespace rotslam {
namespace {

// The frames that have moved, and those next to them.
std::set<FrameId> DoubtfulFrames(const RelocalisedMap& map) {
  constexpr int kAround = 2;
  const CenterMap& frames = map.center_in_world;
  std::set<FrameId> doubtful;
  for (const FrameId frame : map.moved) {
    auto from = frames.find(frame);
    auto to = std::next(from);
    for (int k = 0; k < kAround && from != frames.begin(); ++k) --from;
    for (int k = 0; k < kAround && to != frames.end(); ++k) ++to;
    for (; from != to; ++from) doubtful.insert(from->first);
  }
  return doubtful;
}

// Describes the doubtful frames that are no places yet; whether there are any.
bool DescribeDoubtful(const std::vector<RelocalisedMap>& changed, MendingSources& sources) {
  if (!sources.describe) return false;
  bool has_more = false;
  for (const RelocalisedMap& map : changed) {
    std::set<FrameId> frames = DoubtfulFrames(map);
    std::erase_if(frames, [&](FrameId frame) { return sources.places.contains(frame); });
    if (frames.empty()) continue;
    Reconstruction poses;
    poses.cam_from_world = map.cam_from_world;
    poses.center_in_world = map.center_in_world;
    sources.places.merge(sources.describe(poses, frames));
    has_more = true;
  }
  return has_more;
}

}  // namespace

std::set<FrameId> MendMaps(MendingSources sources,
                           const std::vector<Track>& tracks,
                           const RelocalisationOptions& options,
                           std::uint64_t seed,
                           const BundleOptions& bundle_options,
                           RefinedComponents& refined) {
  // Where some stand right, others are seen to stand wrong.
  constexpr int kMaxPasses = 3;
  std::vector<Track> seen = WithBearingsOf(refined.camera, tracks);
  PlaceMatches places(sources.places, refined.camera);
  const auto relocalise = [&]() {
    std::vector<const Reconstruction*> maps;
    for (const BundleResult& bundle : refined.bundles) maps.push_back(&bundle.reconstruction);
    return Relocalise(maps,
                      seen,
                      places,
                      sources.lookalikes,
                      refined.camera,
                      options,
                      seed,
                      bundle_options.num_threads);
  };
  std::set<FrameId> moved;
  for (int pass = 0; pass < kMaxPasses; ++pass) {
    std::vector<RelocalisedMap> changed = relocalise();
    if (DescribeDoubtful(changed, sources)) changed = relocalise();
    const std::set<FrameId> now =
        RefineRelocalised(changed, sources.held, bundle_options, sources.complete, seen, refined);
    if (now.empty()) break;
    moved.insert(now.begin(), now.end());
  }
  return moved;
}

}  // namespace rotslam
