#include "apps/slam/map_correction/relocalisation.h"

#include <algorithm>
#include <functional>
#include <iterator>
#include <optional>
#include <stdexcept>
#include <utility>

#include "apps/slam/map_correction/frame_finder.h"
#include "rotodom/types/parallel.h"

namespace rotslam {
namespace {

// Results of `find` for 0 to `count` - 1, without the empty ones.
std::vector<FoundFrame> FindEach(int count,
                                 int num_threads,
                                 const std::function<std::optional<FoundFrame>(int)>& find) {
  std::vector<std::optional<FoundFrame>> found(count);
  ParallelFor(count, num_threads, [&](int k) { found[k] = find(k); });
  std::vector<FoundFrame> all;
  for (std::optional<FoundFrame>& one : found) {
    if (one) all.push_back(*std::move(one));
  }
  return all;
}

// Finds the pose of each pair's frame.
std::vector<FoundFrame> FindPairs(const FrameFinder& finder,
                                  const std::vector<Lookalike>& pairs,
                                  int num_threads) {
  return FindEach(static_cast<int>(pairs.size()), num_threads, [&](int k) {
    return finder.IsOpen(pairs[k]) ? finder.Find(pairs[k]) : std::nullopt;
  });
}

// The same; the neighbours of both frames of a pair are tested as well where its frame is
// displaced.
std::vector<FoundFrame> FindAll(const FrameFinder& finder,
                                const std::vector<Lookalike>& lookalikes,
                                int num_threads) {
  std::set<std::pair<FrameId, FrameId>> tried;
  std::vector<Lookalike> pairs;
  const auto add = [&](FrameId frame, FrameId match) {
    if (frame != match && tried.insert({frame, match}).second) pairs.push_back({frame, match});
  };
  for (const Lookalike& pair : lookalikes) add(pair.frame, pair.match);
  std::vector<FoundFrame> all = FindPairs(finder, pairs, num_threads);
  pairs.clear();
  for (const FoundFrame& found : all) {
    if (!found.is_displaced) continue;
    for (const FrameId other : finder.NeighboursOf(found.frame)) add(other, *found.match);
    for (const FrameId other : finder.NeighboursOf(*found.match)) add(found.frame, other);
  }
  for (FoundFrame& found : FindPairs(finder, pairs, num_threads)) all.push_back(std::move(found));
  return all;
}

// Finds the pose of each frame from the points of its own tracks.
std::vector<FoundFrame> FindAllByTracks(const FrameFinder& finder,
                                        const std::vector<Track>& tracks,
                                        int num_threads) {
  std::map<FrameId, std::vector<PointObservation2D3D>> known = finder.PointsOfTracks(tracks);
  std::vector<FrameId> frames;
  frames.reserve(known.size());
  for (const auto& [frame, points] : known) frames.push_back(frame);
  return FindEach(static_cast<int>(frames.size()), num_threads, [&](int k) {
    return finder.FindByTracks(frames[k], known.at(frames[k]));
  });
}

// The frames of one map that are moved: one of each two that contradict each other.
class Displaced {
 public:
  // @param found  poses of frames of the map from points of the same map.
  Displaced(const FrameFinder& finder,
            const Reconstruction& map,
            const std::vector<const FoundFrame*>& found)
      : finder_(finder) {
    Choose(map, found);
    for (const FoundFrame* one : found) {
      if (one->is_displaced) Take(*one);
    }
    std::erase_if(frames_, [&](FrameId frame) { return !move_.contains(frame); });
    if (!frames_.empty()) AddConnectedFrames(map);
  }

  const std::set<FrameId>& frames() const { return frames_; }

  // The similarity found for the frame, or for the moved frame with the most common points; null
  // where there is none.
  const Similarity* MoveOf(FrameId frame) const {
    const auto own = move_.find(frame);
    if (own != move_.end()) return &own->second.move;
    const Similarity* nearest = nullptr;
    int most = 0;
    for (const auto& [other, best] : move_) {
      const int count = finder_.CountCommon(frame, other);
      if (count <= most) continue;
      most = count;
      nearest = &best.move;
    }
    return nearest;
  }

  // Whether the found pose relates a frame that moves to one that stays.
  bool IsTaken(const FoundFrame& found) const {
    if (!found.is_displaced) return false;
    const bool frame_moves = frames_.contains(found.frame);
    if (!found.match) return frame_moves;
    return frame_moves != frames_.contains(*found.match);
  }

 private:
  struct Best {
    int num_inliers = 0;
    Similarity move;
  };

  // Selects the frames to move: in turn the one for which contradictions are the largest share of
  // the evidence.
  void Choose(const Reconstruction& map, const std::vector<const FoundFrame*>& found) {
    std::map<FrameId, double> agreeing;
    for (const FoundFrame* one : found) {
      if (one->is_near) anchored_.insert(one->frame);
      if (!one->is_right) continue;
      agreeing[one->frame] += one->num_agreeing;
      if (!one->by_neighbours) agreeing[*one->match] += one->num_agreeing;
    }
    std::vector<const FoundFrame*> open;
    for (const FoundFrame* one : found) {
      if (one->is_displaced && (one->match || !anchored_.contains(one->frame))) {
        open.push_back(one);
      }
    }
    std::map<FrameId, double> tied;  // points in common with all others
    while (!open.empty()) {
      std::map<FrameId, double> contradicting;
      for (const FoundFrame* one : open) {
        const double gain = one->num_inliers - one->num_present;
        contradicting[one->frame] += gain;
        if (one->match) contradicting[*one->match] += gain;
      }
      FrameId worst;
      double largest = 0.0;
      for (const auto& [frame, gain] : contradicting) {
        if (!tied.contains(frame)) tied[frame] = CountTies(map, frame);
        const double share = gain / (gain + agreeing[frame] + tied[frame]);
        if (share <= largest) continue;
        largest = share;
        worst = frame;
      }
      frames_.insert(worst);
      std::erase_if(
          open, [&](const FoundFrame* one) { return one->frame == worst || one->match == worst; });
    }
  }

  int CountTies(const Reconstruction& map, FrameId frame) const {
    int count = 0;
    for (const auto& [other, center] : map.center_in_world) {
      if (other != frame) count += finder_.CountCommon(frame, other);
    }
    return count;
  }

  void Take(const FoundFrame& found) {
    if (!IsTaken(found)) return;
    const bool frame_moves = frames_.contains(found.frame);
    Best& best = move_[frame_moves ? found.frame : *found.match];
    if (found.num_inliers <= best.num_inliers) return;
    best = {found.num_inliers, frame_moves ? found.move : found.move.Inverse()};
  }

  // Adds frames that share more points with the moved frames than with the rest.
  void AddConnectedFrames(const Reconstruction& map) {
    struct Seers {
      int moving = 0;
      int staying = 0;
    };
    std::map<TrackId, Seers> seers;  // frames that see the point
    for (const auto& [frame, center] : map.center_in_world) {
      const bool moves = frames_.contains(frame);
      for (const TrackId track : finder_.PointsOf(frame)) {
        ++(moves ? seers[track].moving : seers[track].staying);
      }
    }
    for (bool has_added = true; has_added;) {
      has_added = false;
      for (const auto& [frame, center] : map.center_in_world) {
        if (frames_.contains(frame) || anchored_.contains(frame)) continue;
        int with_moving = 0;
        int with_others = 0;
        for (const TrackId track : finder_.PointsOf(frame)) {
          with_moving += seers[track].moving > 0 ? 1 : 0;
          with_others += seers[track].staying > 1 ? 1 : 0;
        }
        if (with_moving <= with_others || MoveOf(frame) == nullptr) continue;
        frames_.insert(frame);
        for (const TrackId track : finder_.PointsOf(frame)) {
          ++seers[track].moving;
          --seers[track].staying;
        }
        has_added = true;
      }
    }
  }

  const FrameFinder& finder_;
  std::set<FrameId> frames_;
  std::set<FrameId> anchored_;  // frames that a found pose confirms near their place
  std::map<FrameId, Best> move_;
};

// Maps merged where they see the same points, in the world of the largest.
class MergedMaps {
 public:
  // @param links  poses of frames of one map from points of another.
  MergedMaps(const FrameFinder& finder,
             const std::vector<const Reconstruction*>& maps,
             std::vector<const FoundFrame*> links)
      : maps_(maps), parts_(maps.size()), move_(maps.size()) {
    for (int k = 0; k < std::ssize(maps); ++k) parts_[k] = {k};
    std::stable_sort(links.begin(), links.end(), [](const FoundFrame* a, const FoundFrame* b) {
      return a->num_inliers > b->num_inliers;
    });
    for (const FoundFrame* link : links) {
      const int from = finder.MapOf(link->frame);
      const int to = finder.MapOf(*link->match);
      if (!parts_[from].contains(to)) Join(from, to, link->move);
    }
  }

  const std::set<int>& PartsWith(int map) const { return parts_[map]; }
  // Similarity into the world of the largest map it is merged with.
  const Similarity& MoveOf(int map) const { return move_[map]; }

  int LargestOf(const std::set<int>& parts) const {
    return *std::max_element(parts.begin(), parts.end(), [&](int a, int b) {
      return maps_[a]->center_in_world.size() < maps_[b]->center_in_world.size();
    });
  }

 private:
  // @param move  from the world of `from` to that of `to`.
  void Join(int from, int to, const Similarity& move) {
    const Similarity into_other = move_[to] * move * move_[from].Inverse();
    std::set<int> both = parts_[from];
    both.insert(parts_[to].begin(), parts_[to].end());
    const bool from_moves = parts_[to].contains(LargestOf(both));
    for (const int k : from_moves ? parts_[from] : parts_[to]) {
      move_[k] = (from_moves ? into_other : into_other.Inverse()) * move_[k];
    }
    for (const int k : both) parts_[k] = both;
  }

  const std::vector<const Reconstruction*>& maps_;
  std::vector<std::set<int>> parts_;  // by map
  std::vector<Similarity> move_;
};

void Append(const std::vector<std::pair<TrackId, Observation>>& more,
            std::vector<std::pair<TrackId, Observation>>& observations) {
  observations.insert(observations.end(), more.begin(), more.end());
}

// Adds the frames of a map, the displaced ones at their new place.
// @param move    into the world of `now`.
// @param stands  whether that is the world of the map.
void AddFrames(const Reconstruction& map,
               const Displaced& displaced,
               const Similarity& move,
               bool stands,
               RelocalisedMap& now) {
  for (const auto& [frame, center] : map.center_in_world) {
    Rotation rotation = map.cam_from_world.at(frame);
    Eigen::Vector3d place = center;
    const bool is_displaced = displaced.frames().contains(frame);
    if (is_displaced) {
      const Similarity& own = *displaced.MoveOf(frame);
      rotation = own.Move(rotation);
      place = own.Move(place);
    }
    if (is_displaced || !stands) now.moved.insert(frame);
    now.cam_from_world[frame] = move.Move(rotation);
    now.center_in_world[frame] = move.Move(place);
  }
}

}  // namespace

std::vector<RelocalisedMap> Relocalise(const RelocalisationInputs& inputs,
                                       const RelocalisationOptions& options,
                                       std::uint64_t seed,
                                       int num_threads,
                                       PlaceMatches& places) {
  if (const auto problem = options.Problem()) {
    throw std::invalid_argument("RelocalisationOptions: " + *problem);
  }
  const std::vector<const Reconstruction*>& maps = inputs.maps;
  const FrameFinder finder(maps, places, inputs.camera, options, seed);
  std::vector<FoundFrame> all = FindAll(finder, inputs.lookalikes, num_threads);
  std::vector<FoundFrame> more = FindAllByTracks(finder, inputs.tracks, num_threads);
  std::move(more.begin(), more.end(), std::back_inserter(all));
  std::vector<const FoundFrame*> links;
  std::vector<std::vector<const FoundFrame*>> inside(maps.size());
  for (const FoundFrame& found : all) {
    const int map = finder.MapOf(found.frame);
    if (found.match && finder.MapOf(*found.match) != map) {
      links.push_back(&found);
    } else {
      inside[map].push_back(&found);
    }
  }
  const MergedMaps joined(finder, maps, links);

  std::vector<RelocalisedMap> changed;
  for (int k = 0; k < std::ssize(maps); ++k) {
    if (*joined.PartsWith(k).begin() != k) continue;
    RelocalisedMap now;
    now.parts = joined.PartsWith(k);
    for (const int part : now.parts) {
      const Displaced displaced(finder, *maps[part], inside[part]);
      for (const FoundFrame* found : inside[part]) {
        if (displaced.IsTaken(*found)) Append(found->observations, now.observations);
      }
      const bool stands = part == joined.LargestOf(now.parts);
      AddFrames(*maps[part], displaced, joined.MoveOf(part), stands, now);
    }
    for (const FoundFrame* link : links) {
      if (now.parts.contains(finder.MapOf(link->frame)) &&
          now.parts.contains(finder.MapOf(*link->match))) {
        Append(link->observations, now.observations);
      }
    }
    if (!now.moved.empty()) changed.push_back(std::move(now));
  }
  return changed;
}

}  // namespace rotslam
