#include "apps/slam/live/live_mapper.h"

#include <algorithm>
#include <iterator>
#include <set>
#include <stdexcept>

#include "apps/slam/live/component_builder.h"
#include "apps/slam/live/place_links.h"
#include "apps/slam/map/component_alignment.h"
#include "apps/slam/map/refinement.h"
#include "ba/window.h"
#include "krot/window.h"

namespace rotslam {
namespace {

// Keyframes that a window adjusts.
constexpr int kWindow = 8;
// Tracks with so many observations per frame place a window's frames; all tracks are triangulated
// then.
constexpr int kWindowObservations = 200;
// Loops are not closed in a map of fewer keyframes.
constexpr int kMinChainKeyframes = 3;

// Adjustment of a window: its cameras are near their places, so that one round on what fits will
// do. The lens is the calibration's.
BundleOptions WindowOptions(BundleOptions options) {
  options = WithFixedLens(options);
  options.fixed_rotation.enabled = false;
  options.preparing_observations = kWindowObservations;
  options.max_final_rounds = 0;
  // Points are needed soon; what two keyframes see is checked by every frame that sees it.
  options.min_track_observations = 2;
  options.num_threads = 1;
  return options;
}

BundleOptions ComponentOptions(BundleOptions options) {
  options = WithFixedLens(options);
  options.max_final_rounds = 1;
  options.num_threads = 1;
  return options;
}

KrotOptions LiveKrotOptions(KrotOptions options) {
  options.use_bracket = false;
  options.start = KrotStart::kL1;
  options.num_threads = 1;
  return options;
}

}  // namespace

LiveMapper::LiveMapper(const Camera& camera, const SlamOptions& options)
    : camera_(camera),
      krot_options_(LiveKrotOptions(options.krot)),
      window_options_(WindowOptions(options.ba)),
      component_options_(ComponentOptions(options.ba)) {
  if (const auto problem = options.Problem()) {
    throw std::invalid_argument("SlamOptions: " + *problem);
  }
  krot_options_.seed = options.seed;
}

std::shared_ptr<const LiveMap> LiveMapper::AddKeyframe(const KeyframeInput& input) {
  map_.AddKeyframe(input);
  const bool is_held = map_.keyframes().at(input.frame).center_in_world.has_value();
  const bool is_placed = is_held || PlaceNewest();
  map_.EndTracks();
  if (is_placed) Publish();
  return published_;
}

bool LiveMapper::PlaceNewest() {
  if (!newest_.is_settled && BuildNewestComponent()) return true;
  if (Extend()) {
    AdjustWindow();
    return true;
  }
  if (!newest_.is_settled) return false;
  BeginComponent();
  return BuildNewestComponent();
}

bool LiveMapper::Extend() {
  if (!map_.has_points()) return false;
  const Reconstruction recent = map_.Recent();
  std::set<FrameId> sought;
  for (const auto& [frame, rotation] : recent.cam_from_world) {
    if (!recent.center_in_world.contains(frame)) sought.insert(frame);
  }
  KrotSolution known;
  known.center_in_world = recent.center_in_world;
  known.point_in_world = recent.point_in_world;
  for (const auto& [frame, center] : recent.center_in_world) known.component[frame] = 0;
  std::vector<Track> tracks;
  for (const Track& track : recent.tracks) {
    if (std::any_of(track.observations.begin(),
                    track.observations.end(),
                    [&](const Observation& seen) { return sought.contains(seen.frame); })) {
      tracks.push_back(track);
    }
  }
  const KrotSolution extended =
      ExtendKnownRotation(known, recent.cam_from_world, tracks, camera_, krot_options_);
  if (!extended.center_in_world.contains(map_.keyframes().rbegin()->first)) return false;
  for (const FrameId frame : sought) {
    const auto center = extended.center_in_world.find(frame);
    if (center == extended.center_in_world.end()) continue;
    map_.SetCenter(frame, center->second, newest_.number);
  }
  return true;
}

void LiveMapper::BeginComponent() {
  // It begins at the newest keyframe that has a place.
  auto first = std::prev(map_.keyframes().end());
  while (first != map_.keyframes().begin() && !first->second.center_in_world) --first;
  newest_.number = num_components_++;
  newest_.first = first->first;
  newest_.is_settled = false;
  newest_.center_in_world = first->second.center_in_world.value_or(Eigen::Vector3d::Zero());
  // The scene behind a rotation is taken to be as far away as the one before it.
  newest_.depth = depth_;
}

bool LiveMapper::BuildNewestComponent() {
  const auto& keyframes = map_.keyframes();
  if (!newest_.first) newest_.first = keyframes.begin()->first;
  if (std::distance(keyframes.find(*newest_.first), keyframes.end()) >
      GrowingMap::kActiveKeyframes) {
    newest_.first = std::prev(keyframes.end(), GrowingMap::kActiveKeyframes)->first;
  }
  ComponentSources sources;
  for (auto entry = keyframes.find(*newest_.first); entry != keyframes.end(); ++entry) {
    sources.cam_from_world[entry->first] = entry->second.cam_from_odometry;
    sources.sigma_rad[entry->first] = entry->second.sigma_rad;
  }
  sources.tracks.reserve(map_.tracks().size());
  for (const auto& [id, track] : map_.tracks()) sources.tracks.push_back(track);
  const auto built = BuildComponent(sources, camera_, krot_options_, component_options_);
  if (!built) return false;
  const FrameId first = built->map.center_in_world.begin()->first;
  Similarity similarity;
  const double depth = MedianDepth(built->map, first);
  if (depth > 0.0) similarity.scale = newest_.depth / depth;
  const GrowingMap::Keyframe& begin = keyframes.at(*newest_.first);
  similarity.turn = begin.cam_from_world.Inverse() * begin.cam_from_odometry;
  similarity.shift = newest_.center_in_world -
                     similarity.scale * (similarity.turn * built->map.center_in_world.at(first));
  map_.ReplaceFrom(*newest_.first, Moved(built->map, similarity), newest_.number);
  newest_.is_settled =
      built->has_parallax || std::ssize(sources.cam_from_world) >= GrowingMap::kActiveKeyframes;
  return true;
}

void LiveMapper::AdjustWindow() {
  std::set<FrameId> window;
  const auto& keyframes = map_.keyframes();
  for (auto entry = keyframes.rbegin(); entry != keyframes.rend() && std::ssize(window) < kWindow;
       ++entry) {
    if (entry->second.center_in_world) window.insert(entry->first);
  }
  BundleProblem problem = WindowProblem(map_.Recent(), camera_, window);
  problem.shared_center.merge(map_.SharedCenters(window));
  const BundleResult refined = RefineBundle(problem, window_options_);
  if (refined.Usable()) {
    map_.TakeAdjusted(window, problem.start.tracks, refined.reconstruction);
  }
}

std::shared_ptr<const LiveMap> LiveMapper::CloseLoops(const LoopInput& input) {
  map_.SetOdometry(input.cam_from_world);
  const KeyframeChain chain = map_.Chain();
  if (std::ssize(chain) < kMinChainKeyframes) return published_;
  const RotationMap cam_from_world = FollowAveraged(input.cam_from_world, chain);
  std::vector<PlaceLink> links;
  std::vector<const RevisitedPoint*> points;
  for (const RevisitedPlace& place : input.places) {
    const auto found = FindPlaceLink(
        place, {map_, chain, cam_from_world, camera_.MeanFocal(), krot_options_.seed});
    if (!found) continue;
    links.push_back(found->link);
    points.insert(points.end(), found->points.begin(), found->points.end());
  }
  const bool is_off = Contradicts(chain, cam_from_world, links, depth_);
  if (!is_off && links.empty()) return published_;
  // A component that is built anew may leave out keyframes.
  std::erase_if(links_, [&](const auto& link) {
    return !chain.contains(link.first) || !chain.contains(link.second);
  });
  if (is_off) MoveMap(CloseLinks(chain, cam_from_world, links_, links));
  JoinLinked(links);
  map_.MergePoints(points);
  if (!links.empty() && newest_.is_settled) AdjustWindow();
  Publish();
  return published_;
}

void LiveMapper::MoveMap(const KeyframeMoves& moves) {
  map_.Move(moves);
  if (newest_.first) {
    const Similarity& move = MoveAt(moves, *newest_.first);
    newest_.center_in_world = move.Move(newest_.center_in_world);
    newest_.depth *= move.scale;
  }
  depth_ *= moves.rbegin()->second.scale;
}

void LiveMapper::JoinLinked(const std::vector<PlaceLink>& links) {
  for (const PlaceLink& link : links) {
    links_.emplace_back(link.older, link.newer);
    const int older = map_.keyframes().at(link.older).component;
    const int newer = map_.keyframes().at(link.newer).component;
    map_.MergeComponents(older, newer);
    if (newest_.number == newer) newest_.number = older;
  }
}

void LiveMapper::Publish() {
  const auto map = std::make_shared<LiveMap>(map_.Snapshot());
  map->revision = ++revision_;
  const double depth = MedianDepth(map_.Recent(), map->Newest()->frame);
  if (depth > 0.0) depth_ = depth;
  published_ = map;
}

}  // namespace rotslam
