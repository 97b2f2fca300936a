#include "apps/slam/live/live_mapper.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <stdexcept>
#include <utility>

#include "apps/slam/map/component_alignment.h"
#include "apps/slam/map/refinement.h"
#include "ba/window.h"
#include "krot/initialisation/resection.h"
#include "krot/known_rotation.h"
#include "krot/window.h"
#include "rotodom/types/median.h"
#include "rotodom/types/similarity.h"
#include "rotodom/types/triangulation.h"

namespace rotslam {
namespace {

// Keyframes that a window adjusts.
constexpr int kWindow = 8;
// A window's frames are placed by so many observations each; all tracks are triangulated then.
constexpr int kWindowObservations = 200;
// A track that none of so many newest keyframes sees has ended.
constexpr int kActiveKeyframes = 12;
// What older keyframes than so many saw is left out of a window's problem.
constexpr int kRecentKeyframes = 20;
// A map begins with at least so many keyframes, the newest among them, and so many points.
constexpr int kMinStartKeyframes = 3;
constexpr int kMinStartPoints = 50;
// A part is built anew with every keyframe until half of its points are seen under this angle:
// from less parallax adjustment does not find out of what a start has got wrong.
constexpr double kGrownUp = 3.0 * kRadFromDeg;

// A loop is used where so many of its points agree on where the newer keyframe is, within so many
// pixels.
constexpr int kMinLinkPoints = 15;
constexpr double kMaxLinkErrorPx = 4.0;
// A map that differs by less than this from what loops say stays: a share of the depth, of the
// scale, and an angle.
constexpr double kLeastCorrection = 0.01;
constexpr double kLeastTurn = 0.2 * kRadFromDeg;

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

BundleOptions StartOptions(BundleOptions options) {
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

// Median distance of the points from the camera that sees them; 0 where there are none.
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

// Median over the points of the largest angle between two of their rays, rad.
double MedianAngle(const Reconstruction& map) {
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

LiveMapper::LiveMapper(const Camera& camera, const SlamOptions& options)
    : camera_(camera),
      krot_options_(LiveKrotOptions(options.krot)),
      window_options_(WindowOptions(options.ba)),
      start_options_(StartOptions(options.ba)) {
  if (const auto problem = options.Problem()) {
    throw std::invalid_argument("SlamOptions: " + *problem);
  }
  krot_options_.seed = options.seed;
}

std::shared_ptr<const LiveMap> LiveMapper::AddKeyframe(const KeyframeInput& input) {
  Keyframe keyframe;
  keyframe.timestamp_s = input.timestamp_s;
  if (!keyframes_.empty()) {
    const auto& [last, before] = *keyframes_.rbegin();
    keyframe.cam_from_world = input.cam_from_world.at(input.frame) *
                              input.cam_from_world.at(last).Inverse() * before.cam_from_world;
    if (input.only_rotated && before.center_in_world) {
      keyframe.center_in_world = before.center_in_world;
      keyframe.part = before.part;
      const auto shared = shared_center_.find(last);
      shared_center_[input.frame] = shared == shared_center_.end() ? last : shared->second;
    }
  }
  const bool is_held = keyframe.center_in_world.has_value();
  keyframes_[input.frame] = keyframe;
  for (const auto& [frame, rotation] : input.cam_from_world) {
    keyframes_.at(frame).cam_from_odometry = rotation;
    const auto sigma = input.sigma_rad.find(frame);
    if (sigma != input.sigma_rad.end()) keyframes_.at(frame).sigma_rad = sigma->second;
  }
  AddObservations(input.frame, input.features);
  const bool is_placed = is_held || PlaceNewest();
  ArchiveTracks();
  if (is_placed) Publish();
  return map_;
}

bool LiveMapper::PlaceNewest() {
  if (is_young_ && StartPart()) return true;
  if (Extend()) {
    AdjustWindow();
    return true;
  }
  if (is_young_) return false;
  BeginPart();
  return StartPart();
}

void LiveMapper::AddObservations(FrameId frame, const Features& features) {
  for (int n = 0; n < features.size(); ++n) {
    Track& track = tracks_[features.tracks[n]];
    if (track.observations.empty()) {
      track.id = features.tracks[n];
      track.rgb = features.rgb[n];
    }
    track.observations.push_back({frame, features.keypoints_px[n], features.bearings[n]});
  }
}

// The newest keyframes, and what they see, also where older ones have seen that before a loop.
Reconstruction LiveMapper::RecentMap() const {
  Reconstruction map;
  const auto take = [&](FrameId frame, const Keyframe& keyframe) {
    map.cam_from_world[frame] = keyframe.cam_from_world;
    if (keyframe.center_in_world) map.center_in_world[frame] = *keyframe.center_in_world;
  };
  auto entry = keyframes_.rbegin();
  for (int k = 0; k < kRecentKeyframes && entry != keyframes_.rend(); ++k, ++entry) {
    take(entry->first, entry->second);
  }
  const FrameId oldest = map.cam_from_world.begin()->first;
  map.point_in_world = points_;
  map.tracks.reserve(tracks_.size());
  for (const auto& [id, track] : tracks_) {
    Track recent{id, {}, track.rgb};
    const bool is_revisited = revisited_.contains(id);
    for (const Observation& observation : track.observations) {
      if (observation.frame < oldest && !is_revisited) continue;
      if (observation.frame < oldest) take(observation.frame, keyframes_.at(observation.frame));
      recent.observations.push_back(observation);
    }
    if (recent.observations.size() >= 2) map.tracks.push_back(std::move(recent));
  }
  return map;
}

bool LiveMapper::Extend() {
  if (points_.empty()) return false;
  const Reconstruction recent = RecentMap();
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
  if (!extended.center_in_world.contains(keyframes_.rbegin()->first)) return false;
  for (const FrameId frame : sought) {
    const auto center = extended.center_in_world.find(frame);
    if (center == extended.center_in_world.end()) continue;
    keyframes_.at(frame).center_in_world = center->second;
    keyframes_.at(frame).part = part_;
  }
  return true;
}

void LiveMapper::BeginPart() {
  // From the newest keyframe that has a position, whose place is known.
  auto first = std::prev(keyframes_.end());
  while (first != keyframes_.begin() && !first->second.center_in_world) --first;
  first_ = first->first;
  is_young_ = true;
  part_ = num_parts_++;
  part_center_ = first->second.center_in_world.value_or(Eigen::Vector3d::Zero());
  // The scene behind a turn is taken to be as far away as the one before it.
  part_depth_ = depth_;
}

bool LiveMapper::StartPart() {
  if (!first_) first_ = keyframes_.begin()->first;
  if (std::distance(keyframes_.find(*first_), keyframes_.end()) > kActiveKeyframes) {
    first_ = std::prev(keyframes_.end(), kActiveKeyframes)->first;
  }
  RotationMap rotations;
  std::map<FrameId, double> sigma_rad;
  std::set<FrameId> frames;
  for (auto entry = keyframes_.find(*first_); entry != keyframes_.end(); ++entry) {
    frames.insert(entry->first);
    rotations[entry->first] = entry->second.cam_from_odometry;
    sigma_rad[entry->first] = entry->second.sigma_rad;
  }
  if (std::ssize(frames) < kMinStartKeyframes) return false;
  std::vector<Track> all;
  all.reserve(tracks_.size());
  for (const auto& [id, track] : tracks_) all.push_back(track);
  const std::vector<Track> tracks = RestrictTracks(all, frames, kMinTrackObservations);
  const KrotSolution solution =
      SolveKnownRotation(rotations, tracks, camera_, krot_options_, sigma_rad);
  if (!solution.Usable() || solution.status == KrotStatus::kContradiction) return false;
  MapComponent component;
  for (const auto& [frame, number] : solution.component) {
    if (number == 0) component.keyframes.insert(frame);
  }
  const FrameId newest = keyframes_.rbegin()->first;
  const auto is_start = [&](const std::set<FrameId>& placed) {
    return std::ssize(placed) >= kMinStartKeyframes && placed.contains(newest);
  };
  if (!is_start(component.keyframes)) return false;
  const BundleResult refined = RefineComponent(
      component, {rotations, solution.center_in_world, tracks}, camera_, start_options_, nullptr);
  if (!refined.Usable()) return false;
  const Reconstruction& part = refined.reconstruction;
  std::set<FrameId> placed;
  for (const auto& [frame, center] : part.center_in_world) placed.insert(frame);
  if (!is_start(placed) || std::ssize(part.point_in_world) < kMinStartPoints) return false;
  TakePart(part);
  const double angle = MedianAngle(part);
  is_young_ = std::ssize(frames) < kActiveKeyframes && angle < kGrownUp;
  return true;
}

void LiveMapper::TakePart(const Reconstruction& part) {
  const FrameId first = part.center_in_world.begin()->first;
  Similarity similarity;
  const double depth = MedianDepth(part, first);
  if (depth > 0.0) similarity.scale = part_depth_ / depth;
  similarity.turn =
      keyframes_.at(*first_).cam_from_world.Inverse() * keyframes_.at(*first_).cam_from_odometry;
  similarity.shift =
      part_center_ - similarity.scale * (similarity.turn * part.center_in_world.at(first));
  const Reconstruction moved = Moved(part, similarity);
  for (auto entry = keyframes_.find(*first_); entry != keyframes_.end(); ++entry) {
    auto& [frame, keyframe] = *entry;
    const auto center = moved.center_in_world.find(frame);
    if (center != moved.center_in_world.end()) {
      keyframe.cam_from_world = moved.cam_from_world.at(frame);
      keyframe.center_in_world = center->second;
      keyframe.part = part_;
    } else if (frame != *first_) {
      keyframe.center_in_world.reset();
    }
  }
  for (const auto& [id, track] : tracks_) {
    if (track.observations.back().frame > *first_) points_.erase(id);
  }
  points_.insert(moved.point_in_world.begin(), moved.point_in_world.end());
}

void LiveMapper::AdjustWindow() {
  std::set<FrameId> window;
  for (auto entry = keyframes_.rbegin(); entry != keyframes_.rend() && std::ssize(window) < kWindow;
       ++entry) {
    if (entry->second.center_in_world) window.insert(entry->first);
  }
  BundleProblem problem = WindowProblem(RecentMap(), camera_, window);
  for (const FrameId frame : window) {
    const auto shared = shared_center_.find(frame);
    if (shared != shared_center_.end() && window.contains(shared->second)) {
      problem.shared_center.insert(*shared);
    }
  }
  const BundleResult refined = RefineBundle(problem, window_options_);
  if (!refined.Usable()) return;
  const Reconstruction& found = refined.reconstruction;
  for (const FrameId frame : window) {
    const auto center = found.center_in_world.find(frame);
    if (center == found.center_in_world.end()) continue;
    keyframes_.at(frame).cam_from_world = found.cam_from_world.at(frame);
    keyframes_.at(frame).center_in_world = center->second;
  }
  for (const Track& track : problem.start.tracks) points_.erase(track.id);
  points_.insert(found.point_in_world.begin(), found.point_in_world.end());
}

KeyframeChain LiveMapper::Chain() const {
  KeyframeChain chain;
  for (const auto& [frame, keyframe] : keyframes_) {
    if (!keyframe.center_in_world) continue;
    chain[frame] = {keyframe.cam_from_world, *keyframe.center_in_world, keyframe.part};
  }
  return chain;
}

const LiveMapper::OldPoint* LiveMapper::FindOldPoint(TrackId track) const {
  const auto old = std::lower_bound(
      old_points_.begin(), old_points_.end(), track, [](const OldPoint& point, TrackId sought) {
        return point.point.track < sought;
      });
  return old != old_points_.end() && old->point.track == track ? &*old : nullptr;
}

const Eigen::Vector3d* LiveMapper::FindPointOf(TrackId track) const {
  for (auto merged = merged_into_.find(track); merged != merged_into_.end();
       merged = merged_into_.find(track)) {
    track = merged->second;
  }
  const auto active = points_.find(track);
  if (active != points_.end()) return &active->second;
  const OldPoint* old = FindOldPoint(track);
  return old == nullptr ? nullptr : &old->point.point_in_world;
}

std::optional<LiveMapper::FoundLink> LiveMapper::FindLink(const RevisitedPlace& place,
                                                          const KeyframeChain& chain,
                                                          const RotationMap& cam_from_world) const {
  const auto older = chain.find(place.older);
  if (older == chain.end()) return std::nullopt;
  struct Seen {
    const RevisitedPoint* point;
    const Eigen::Vector3d* older_point;
    Eigen::Vector3d bearing;
  };
  std::map<FrameId, std::vector<Seen>> seen_by;  // by newer keyframe
  for (const RevisitedPoint& point : place.points) {
    const auto track = tracks_.find(point.newer);
    const Eigen::Vector3d* older_point = FindPointOf(point.older);
    if (track == tracks_.end() || older_point == nullptr) continue;
    for (const Observation& seen : track->second.observations) {
      if (seen.frame <= place.older || !chain.contains(seen.frame)) continue;
      seen_by[seen.frame].push_back({&point, older_point, seen.bearing});
    }
  }
  const auto most =
      std::max_element(seen_by.begin(), seen_by.end(), [](const auto& a, const auto& b) {
        return a.second.size() < b.second.size();
      });
  if (most == seen_by.end() || std::ssize(most->second) < kMinLinkPoints) return std::nullopt;
  const auto& [newer, seen] = *most;
  // Its orientation in the older keyframe's world.
  const Rotation newer_from_world = cam_from_world.at(newer) *
                                    cam_from_world.at(place.older).Inverse() *
                                    older->second.cam_from_world;
  std::vector<PosedRay> rays;
  rays.reserve(seen.size());
  for (const Seen& one : seen) {
    rays.push_back({Rotation(), *one.older_point, -(newer_from_world.Inverse() * one.bearing)});
  }
  const auto resected = ResectCenter(
      rays, {kMaxLinkErrorPx / camera_.MeanFocal(), /*max_samples=*/200, krot_options_.seed});
  if (!resected || std::ssize(resected->inliers) < kMinLinkPoints) return std::nullopt;
  FoundLink found;
  std::vector<double> ratios;
  for (const int n : resected->inliers) {
    found.points.push_back(seen[n].point);
    const Eigen::Vector3d* newer_point = FindPointOf(seen[n].point->newer);
    if (newer_point == nullptr) continue;
    ratios.push_back((*seen[n].older_point - resected->center_in_world).norm() /
                     (*newer_point - chain.at(newer).center_in_world).norm());
  }
  if (std::ssize(ratios) < kMinLinkPoints) return std::nullopt;
  found.link.older = place.older;
  found.link.newer = newer;
  found.link.scale = Median(std::move(ratios));
  found.link.newer_in_older =
      older->second.cam_from_world * (resected->center_in_world - older->second.center_in_world);
  if (!(found.link.scale > 0.0) || !found.link.newer_in_older.allFinite()) return std::nullopt;
  return found;
}

// Whether the map contradicts new orientations, or a link.
bool LiveMapper::IsOff(const KeyframeChain& chain,
                       const RotationMap& cam_from_world,
                       const std::vector<PlaceLink>& links) const {
  for (const auto& [frame, keyframe] : chain) {
    const Rotation turn = cam_from_world.at(frame) * keyframe.cam_from_world.Inverse();
    if (turn.Angle() > kLeastTurn) return true;
  }
  return std::any_of(links.begin(), links.end(), [&](const PlaceLink& link) {
    const ChainedKeyframe& older = chain.at(link.older);
    const ChainedKeyframe& newer = chain.at(link.newer);
    const Eigen::Vector3d gap = older.cam_from_world.Inverse() * link.newer_in_older -
                                (newer.center_in_world - older.center_in_world);
    return older.part != newer.part || std::abs(std::log(link.scale)) > kLeastCorrection ||
           gap.norm() > kLeastCorrection * depth_;
  });
}

std::shared_ptr<const LiveMap> LiveMapper::CloseLoops(const LoopInput& input) {
  for (const auto& [frame, rotation] : input.cam_from_world) {
    keyframes_.at(frame).cam_from_odometry = rotation;
  }
  const KeyframeChain chain = Chain();
  if (std::ssize(chain) < kMinStartKeyframes) return map_;
  const RotationMap bent = BendTo(input.cam_from_world, chain);
  std::vector<PlaceLink> links;
  std::vector<const RevisitedPoint*> points;
  for (const RevisitedPlace& place : input.places) {
    const auto found = FindLink(place, chain, bent);
    if (!found) continue;
    links.push_back(found->link);
    points.insert(points.end(), found->points.begin(), found->points.end());
  }
  const bool is_off = IsOff(chain, bent, links);
  if (!is_off && links.empty()) return map_;
  // A part that is built anew may leave out keyframes.
  std::erase_if(links_, [&](const auto& link) {
    return !chain.contains(link.first) || !chain.contains(link.second);
  });
  if (is_off) MoveMap(CloseLinks(chain, bent, links_, links));
  for (const PlaceLink& link : links) {
    links_.emplace_back(link.older, link.newer);
    MergeParts(keyframes_.at(link.older).part, keyframes_.at(link.newer).part);
  }
  MergePoints(points);
  if (!links.empty() && !is_young_) AdjustWindow();
  Publish();
  return map_;
}

void LiveMapper::MoveMap(const std::map<FrameId, Similarity>& moves) {
  // What a keyframe without a centre has seen moves like what the one before it has.
  const auto at = [&](FrameId frame) -> const Similarity& {
    auto after = moves.upper_bound(frame);
    return (after == moves.begin() ? after : std::prev(after))->second;
  };
  for (auto& [frame, keyframe] : keyframes_) {
    const Similarity& move = at(frame);
    keyframe.cam_from_world = move.Move(keyframe.cam_from_world);
    keyframe.scale *= move.scale;
    if (keyframe.center_in_world) keyframe.center_in_world = move.Move(*keyframe.center_in_world);
  }
  for (auto& [id, point] : points_)
    point = at(tracks_.at(id).observations.back().frame).Move(point);
  for (OldPoint& old : old_points_) {
    old.point.point_in_world = at(old.keyframe).Move(old.point.point_in_world);
  }
  if (first_) {
    const Similarity& move = at(*first_);
    part_center_ = move.Move(part_center_);
    part_depth_ *= move.scale;
  }
  const Similarity& newest = moves.rbegin()->second;
  depth_ *= newest.scale;
  moved_ = newest * moved_;
  ++num_corrections_;
}

void LiveMapper::MergeParts(int older, int newer) {
  if (older == newer) return;
  for (auto& [frame, keyframe] : keyframes_) {
    if (keyframe.part == newer) keyframe.part = older;
  }
  if (part_ == newer) part_ = older;
}

void LiveMapper::MergePoints(const std::vector<const RevisitedPoint*>& points) {
  std::set<TrackId> merged;
  for (const RevisitedPoint* revisited : points) {
    const auto newer = tracks_.find(revisited->newer);
    if (newer == tracks_.end() || merged_into_.contains(revisited->older)) continue;
    const OldPoint* older = FindOldPoint(revisited->older);
    if (older == nullptr) continue;
    std::vector<Observation>& observations = newer->second.observations;
    std::vector<Observation> before;
    for (const Observation& observation : revisited->observations) {
      const auto keyframe = keyframes_.find(observation.frame);
      const bool is_known = keyframe != keyframes_.end() && keyframe->second.center_in_world;
      if (is_known && observation.frame < observations.front().frame) before.push_back(observation);
    }
    if (before.empty()) continue;
    observations.insert(observations.begin(), before.begin(), before.end());
    points_.insert_or_assign(revisited->newer, older->point.point_in_world);
    merged_into_[revisited->older] = revisited->newer;
    merged.insert(revisited->older);
    revisited_.insert(revisited->newer);
  }
  std::erase_if(old_points_,
                [&](const OldPoint& point) { return merged.contains(point.point.track); });
}

void LiveMapper::ArchiveTracks() {
  if (std::ssize(keyframes_) <= kActiveKeyframes) return;
  const FrameId oldest = std::prev(keyframes_.end(), kActiveKeyframes)->first;
  const auto num_old = static_cast<std::ptrdiff_t>(old_points_.size());
  for (auto entry = tracks_.begin(); entry != tracks_.end();) {
    Track& track = entry->second;
    if (track.observations.back().frame >= oldest) {
      ++entry;
      continue;
    }
    const auto point = points_.find(track.id);
    if (point != points_.end()) {
      const FrameId keyframe = track.observations.back().frame;
      old_points_.push_back({{track.id, point->second, track.rgb}, keyframe});
      points_.erase(point);
    }
    revisited_.erase(track.id);
    entry = tracks_.erase(entry);
  }
  const auto by_track = [](const OldPoint& a, const OldPoint& b) {
    return a.point.track < b.point.track;
  };
  std::inplace_merge(
      old_points_.begin(), old_points_.begin() + num_old, old_points_.end(), by_track);
}

void LiveMapper::Publish() {
  const auto map = std::make_shared<LiveMap>();
  map->revision = ++revision_;
  for (const auto& [frame, keyframe] : keyframes_) {
    if (!keyframe.center_in_world) continue;
    map->keyframes.push_back({frame,
                              keyframe.timestamp_s,
                              keyframe.cam_from_world,
                              *keyframe.center_in_world,
                              keyframe.part,
                              keyframe.scale});
  }
  const Reconstruction recent = RecentMap();
  const double depth = MedianDepth(recent, map->keyframes.back().frame);
  if (depth > 0.0) depth_ = depth;
  std::vector<LivePoint> active;
  active.reserve(points_.size());
  for (const auto& [id, point] : points_) active.push_back({id, point, tracks_.at(id).rgb});
  std::vector<LivePoint> old;
  old.reserve(old_points_.size());
  for (const OldPoint& point : old_points_) old.push_back(point.point);
  map->points.reserve(old.size() + active.size());
  std::merge(old.begin(),
             old.end(),
             active.begin(),
             active.end(),
             std::back_inserter(map->points),
             [](const LivePoint& a, const LivePoint& b) { return a.track < b.track; });
  map->num_corrections = num_corrections_;
  map->moved = moved_;
  map_ = map;
}

}  // namespace rotslam
