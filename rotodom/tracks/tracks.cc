#include "rotodom/tracks/tracks.h"

#include <algorithm>
#include <numeric>
#include <stdexcept>

namespace rotslam {
namespace {

// Disjoint sets of keypoints with at most one keypoint per frame in each set.
class TrackSets {
 public:
  explicit TrackSets(std::vector<int> frame_of)
      : parent_(frame_of.size()), frames_(frame_of.size()) {
    std::iota(parent_.begin(), parent_.end(), 0);
    for (std::size_t node = 0; node < frame_of.size(); ++node) frames_[node] = {frame_of[node]};
  }

  int Find(int node) {
    while (parent_[node] != node) node = parent_[node] = parent_[parent_[node]];
    return node;
  }

  void Join(int a, int b) {
    a = Find(a);
    b = Find(b);
    if (a == b) return;
    if (frames_[a].size() < frames_[b].size()) std::swap(a, b);
    std::vector<int> merged;
    merged.reserve(frames_[a].size() + frames_[b].size());
    std::merge(frames_[a].begin(),
               frames_[a].end(),
               frames_[b].begin(),
               frames_[b].end(),
               std::back_inserter(merged));
    if (std::adjacent_find(merged.begin(), merged.end()) != merged.end()) return;
    frames_[a] = std::move(merged);
    frames_[b].clear();
    frames_[b].shrink_to_fit();
    parent_[b] = a;
  }

 private:
  std::vector<int> parent_;
  std::vector<std::vector<int>> frames_;  // ascending, kept at the root
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
  TrackSets sets(frame_of);
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

  std::vector<Track> tracks;
  std::vector<int> track_of_root(frame_of.size(), -1);
  for (const auto& [frame, frame_features] : features) {
    if (!observed_from.contains(frame)) continue;
    for (int index = 0; index < frame_features.size(); ++index) {
      int& slot = track_of_root[sets.Find(first_node.at(frame) + index)];
      if (slot < 0) {
        slot = static_cast<int>(tracks.size());
        tracks.emplace_back().rgb = frame_features.rgb[index];
      }
      tracks[slot].observations.push_back(
          {frame, frame_features.keypoints_px[index], frame_features.bearings[index], 1.0});
    }
  }
  std::erase_if(tracks, [&](const Track& track) {
    return static_cast<int>(track.observations.size()) < min_length;
  });
  for (int id = 0; id < static_cast<int>(tracks.size()); ++id) tracks[id].id = TrackId{id};
  return tracks;
}

}  // namespace rotslam
