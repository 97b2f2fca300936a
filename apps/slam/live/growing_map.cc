#include "apps/slam/live/growing_map.h"

#include <algorithm>
#include <iterator>
#include <utility>

namespace rotslam {
namespace {

// Observations in older keyframes than so many are left out of Recent().
constexpr int kRecentKeyframes = 20;

}  // namespace

void GrowingMap::AddKeyframe(const KeyframeInput& input) {
  Keyframe keyframe;
  keyframe.timestamp_s = input.timestamp_s;
  if (!keyframes_.empty()) {
    const auto& [last, before] = *keyframes_.rbegin();
    keyframe.cam_from_world = input.cam_from_world.at(input.frame) *
                              input.cam_from_world.at(last).Inverse() * before.cam_from_world;
    if (input.only_rotated && before.center_in_world) {
      keyframe.center_in_world = before.center_in_world;
      keyframe.component = before.component;
      const auto shared = shared_center_.find(last);
      shared_center_[input.frame] = shared == shared_center_.end() ? last : shared->second;
    }
  }
  keyframes_[input.frame] = keyframe;
  SetOdometry(input.cam_from_world);
  for (const auto& [frame, sigma_rad] : input.sigma_rad) keyframes_.at(frame).sigma_rad = sigma_rad;
  AddObservations(input.frame, input.features);
}

void GrowingMap::AddObservations(FrameId frame, const Features& features) {
  for (int n = 0; n < features.size(); ++n) {
    Track& track = tracks_[features.tracks[n]];
    if (track.observations.empty()) {
      track.id = features.tracks[n];
      track.rgb = features.rgb[n];
    }
    track.observations.push_back({frame, features.keypoints_px[n], features.bearings[n]});
  }
}

void GrowingMap::SetOdometry(const RotationMap& cam_from_world) {
  for (const auto& [frame, rotation] : cam_from_world) {
    keyframes_.at(frame).cam_from_odometry = rotation;
  }
}

void GrowingMap::SetCenter(FrameId frame, const Eigen::Vector3d& center_in_world, int component) {
  Keyframe& keyframe = keyframes_.at(frame);
  keyframe.center_in_world = center_in_world;
  keyframe.component = component;
}

void GrowingMap::ReplaceFrom(FrameId first, const Reconstruction& built, int component) {
  for (auto entry = keyframes_.find(first); entry != keyframes_.end(); ++entry) {
    auto& [frame, keyframe] = *entry;
    const auto center = built.center_in_world.find(frame);
    if (center != built.center_in_world.end()) {
      keyframe.cam_from_world = built.cam_from_world.at(frame);
      keyframe.center_in_world = center->second;
      keyframe.component = component;
    } else if (frame != first) {
      keyframe.center_in_world.reset();
    }
  }
  for (const auto& [id, track] : tracks_) {
    if (track.observations.back().frame > first) points_.erase(id);
  }
  points_.insert(built.point_in_world.begin(), built.point_in_world.end());
}

void GrowingMap::TakeAdjusted(const std::set<FrameId>& window,
                              const std::vector<Track>& tracks,
                              const Reconstruction& adjusted) {
  for (const FrameId frame : window) {
    const auto center = adjusted.center_in_world.find(frame);
    if (center == adjusted.center_in_world.end()) continue;
    keyframes_.at(frame).cam_from_world = adjusted.cam_from_world.at(frame);
    keyframes_.at(frame).center_in_world = center->second;
  }
  for (const Track& track : tracks) points_.erase(track.id);
  points_.insert(adjusted.point_in_world.begin(), adjusted.point_in_world.end());
}

void GrowingMap::Move(const KeyframeMoves& moves) {
  for (auto& [frame, keyframe] : keyframes_) {
    const Similarity& move = MoveAt(moves, frame);
    keyframe.cam_from_world = move.Move(keyframe.cam_from_world);
    keyframe.scale *= move.scale;
    if (keyframe.center_in_world) keyframe.center_in_world = move.Move(*keyframe.center_in_world);
  }
  for (auto& [id, point] : points_) {
    point = MoveAt(moves, tracks_.at(id).observations.back().frame).Move(point);
  }
  for (OldPoint& old : old_points_) {
    old.point.point_in_world = MoveAt(moves, old.keyframe).Move(old.point.point_in_world);
  }
  moved_ = moves.rbegin()->second * moved_;
  ++num_corrections_;
}

void GrowingMap::MergeComponents(int older, int newer) {
  for (auto& [frame, keyframe] : keyframes_) {
    if (keyframe.component == newer) keyframe.component = older;
  }
}

void GrowingMap::MergePoints(const std::vector<const RevisitedPoint*>& points) {
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

void GrowingMap::EndTracks() {
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

Reconstruction GrowingMap::Recent() const {
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

std::map<FrameId, FrameId> GrowingMap::SharedCenters(const std::set<FrameId>& window) const {
  std::map<FrameId, FrameId> shared_centers;
  for (const FrameId frame : window) {
    const auto shared = shared_center_.find(frame);
    if (shared != shared_center_.end() && window.contains(shared->second)) {
      shared_centers.insert(*shared);
    }
  }
  return shared_centers;
}

KeyframeChain GrowingMap::Chain() const {
  KeyframeChain chain;
  for (const auto& [frame, keyframe] : keyframes_) {
    if (!keyframe.center_in_world) continue;
    chain[frame] = {keyframe.cam_from_world, *keyframe.center_in_world, keyframe.component};
  }
  return chain;
}

const GrowingMap::OldPoint* GrowingMap::FindOldPoint(TrackId track) const {
  const auto old = std::lower_bound(
      old_points_.begin(), old_points_.end(), track, [](const OldPoint& point, TrackId sought) {
        return point.point.track < sought;
      });
  return old != old_points_.end() && old->point.track == track ? &*old : nullptr;
}

const Eigen::Vector3d* GrowingMap::FindPoint(TrackId track) const {
  for (auto merged = merged_into_.find(track); merged != merged_into_.end();
       merged = merged_into_.find(track)) {
    track = merged->second;
  }
  const auto active = points_.find(track);
  if (active != points_.end()) return &active->second;
  const OldPoint* old = FindOldPoint(track);
  return old == nullptr ? nullptr : &old->point.point_in_world;
}

LiveMap GrowingMap::Snapshot() const {
  LiveMap map;
  for (const auto& [frame, keyframe] : keyframes_) {
    if (!keyframe.center_in_world) continue;
    map.keyframes.push_back({frame,
                             keyframe.timestamp_s,
                             keyframe.cam_from_world,
                             *keyframe.center_in_world,
                             keyframe.component,
                             keyframe.scale});
  }
  std::vector<LivePoint> active;
  active.reserve(points_.size());
  for (const auto& [id, point] : points_) active.push_back({id, point, tracks_.at(id).rgb});
  std::vector<LivePoint> old;
  old.reserve(old_points_.size());
  for (const OldPoint& point : old_points_) old.push_back(point.point);
  map.points.reserve(old.size() + active.size());
  std::merge(old.begin(),
             old.end(),
             active.begin(),
             active.end(),
             std::back_inserter(map.points),
             [](const LivePoint& a, const LivePoint& b) { return a.track < b.track; });
  map.num_corrections = num_corrections_;
  map.moved = moved_;
  return map;
}

}  // namespace rotslam
