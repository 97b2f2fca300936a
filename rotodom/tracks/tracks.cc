#include "rotodom/tracks/tracks.h"

#include <algorithm>
#include <numeric>
#include <stdexcept>
#include <utility>

namespace rotslam {
namespace {

// Disjoint sets of keypoints with at most one keypoint per frame in each set. The keypoints of a
// set are a list in the order of their frames.
class TrackSets {
 public:
  explicit TrackSets(std::vector<int> frame_of)
      : frame_of_(std::move(frame_of)),
        parent_(frame_of_.size()),
        first_(frame_of_.size()),
        last_(frame_of_.size()),
        next_(frame_of_.size(), kNone) {
    std::iota(parent_.begin(), parent_.end(), 0);
    std::iota(first_.begin(), first_.end(), 0);
    std::iota(last_.begin(), last_.end(), 0);
  }

  int Find(int node) {
    while (parent_[node] != node) node = parent_[node] = parent_[parent_[node]];
    return node;
  }

  void Join(int a, int b) {
    a = Find(a);
    b = Find(b);
    if (a == b) return;
    // Most matches lead to a frame after all others.
    if (frame_of_[last_[a]] > frame_of_[last_[b]]) std::swap(a, b);
    if (frame_of_[last_[a]] < frame_of_[first_[b]]) {
      next_[last_[a]] = first_[b];
      last_[a] = last_[b];
      parent_[b] = a;
      return;
    }
    if (HaveCommonFrame(first_[a], first_[b])) return;
    const int last = last_[b];
    first_[a] = Merged(first_[a], first_[b]);
    last_[a] = last;
    parent_[b] = a;
  }

 private:
  static constexpr int kNone = -1;

  bool HaveCommonFrame(int a, int b) const {
    while (a != kNone && b != kNone) {
      if (frame_of_[a] == frame_of_[b]) return true;
      int& earlier = frame_of_[a] < frame_of_[b] ? a : b;
      earlier = next_[earlier];
    }
    return false;
  }

  // The first keypoint of the list of both.
  int Merged(int a, int b) {
    int first = kNone;
    int* link = &first;
    while (a != kNone && b != kNone) {
      int& earlier = frame_of_[a] < frame_of_[b] ? a : b;
      *link = earlier;
      link = &next_[earlier];
      earlier = *link;
    }
    *link = a != kNone ? a : b;
    return first;
  }

  std::vector<int> frame_of_;
  std::vector<int> parent_;
  // Of the set's list, kept at the root.
  std::vector<int> first_;
  std::vector<int> last_;
  std::vector<int> next_;
};

}  // namespace

std::vector<Track> BuildTracks(const std::vector<EdgeMatches>& edges,
                               const std::map<FrameId, Features>& features,
                               const std::set<FrameId>& observed_from,
                               int min_length) {
  std::map<FrameId, int> first_node;
  std::vector<int> frame_of;
  for (const auto& [frame, frame_features] : features) {
    first_node[frame] = static_cast<int>(frame_of.size());
    frame_of.insert(frame_of.end(), frame_features.size(), frame.value);
  }
  const std::size_t num_keypoints = frame_of.size();
  TrackSets sets(std::move(frame_of));
  for (const EdgeMatches& edge : edges) {
    if (!first_node.contains(edge.frame_i) || !first_node.contains(edge.frame_j)) {
      throw std::invalid_argument("BuildTracks: an edge names a frame without features");
    }
    const int num_i = features.at(edge.frame_i).size();
    const int num_j = features.at(edge.frame_j).size();
    for (const auto& [i, j] : edge.pairs) {
      if (i < 0 || i >= num_i || j < 0 || j >= num_j) {
        throw std::invalid_argument("BuildTracks: an edge names a keypoint that its frame lacks");
      }
      sets.Join(first_node.at(edge.frame_i) + i, first_node.at(edge.frame_j) + j);
    }
  }

  std::vector<int> length(num_keypoints, 0);  // at roots: observations that are returned
  for (const auto& [frame, frame_features] : features) {
    if (!observed_from.contains(frame)) continue;
    const int first = first_node.at(frame);
    for (int index = 0; index < frame_features.size(); ++index) ++length[sets.Find(first + index)];
  }
  std::vector<Track> tracks;
  std::vector<int> track_of_root(num_keypoints, -1);
  for (const auto& [frame, frame_features] : features) {
    if (!observed_from.contains(frame)) continue;
    for (int index = 0; index < frame_features.size(); ++index) {
      const int root = sets.Find(first_node.at(frame) + index);
      if (length[root] < min_length) continue;
      int& slot = track_of_root[root];
      if (slot < 0) {
        slot = static_cast<int>(tracks.size());
        tracks.emplace_back().rgb = frame_features.rgb[index];
        tracks.back().observations.reserve(length[root]);
      }
      tracks[slot].observations.push_back(
          {frame, frame_features.keypoints_px[index], frame_features.bearings[index], 1.0});
    }
  }
  for (int id = 0; id < static_cast<int>(tracks.size()); ++id) tracks[id].id = TrackId{id};
  return tracks;
}

}  // namespace rotslam
