#include "apps/cli/run_directory/map_files.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

#include "output/map/map_keypoints.h"
#include "output/map/run_map.h"
#include "output/map/thumbnails_file.h"
#include "output/map/view_graph_matches.h"

namespace rotslam {
namespace {

constexpr std::uint8_t kUnknownLevel = 255;

// Gives each sighting of `tracks` that is in the map the level of its frame's feature whose
// keypoint it is to the last bit.
void FindLevels(const std::map<FrameId, Features>& features,
                const std::vector<Track>& tracks,
                RunMap& map) {
  std::map<FrameId, std::vector<std::pair<TrackId, Eigen::Vector2d>>> sightings;
  for (const Track& track : tracks) {
    for (const Observation& seen : track.observations) {
      sightings[seen.frame].emplace_back(track.id, seen.keypoint_px);
    }
  }
  for (const auto& [frame, of_frame] : sightings) {
    const auto found = features.find(frame);
    if (found == features.end()) continue;
    std::map<std::pair<double, double>, int> level_at;
    for (int k = 0; k < found->second.size(); ++k) {
      const Eigen::Vector2d& keypoint_px = found->second.keypoints_px[k];
      level_at[{keypoint_px.x(), keypoint_px.y()}] = found->second.levels[k];
    }
    for (const auto& [id, keypoint_px] : of_frame) {
      const auto level = level_at.find({keypoint_px.x(), keypoint_px.y()});
      const auto entry = std::lower_bound(
          map.tracks.begin(), map.tracks.end(), id, [](const MapTrack& track, TrackId wanted) {
            return track.track.id < wanted;
          });
      if (level == level_at.end() || entry == map.tracks.end() || entry->track.id != id) continue;
      const std::vector<Observation>& observations = entry->track.observations;
      for (std::size_t k = 0; k < observations.size(); ++k) {
        if (observations[k].frame != frame) continue;
        entry->levels[k] = static_cast<std::uint8_t>(level->second);
      }
    }
  }
}

// Sets the pyramid levels that the tracker did not give: that of the track's observation in the
// nearest frame, changed by the ratio of both distances to the point.
void GuessUnknownLevels(RunMap& map) {
  std::map<FrameId, Eigen::Vector3d> centers;
  for (const MapFrame& frame : map.frames) centers[frame.id] = frame.center_in_world;
  for (MapTrack& entry : map.tracks) {
    std::vector<std::size_t> known;
    for (std::size_t k = 0; k < entry.levels.size(); ++k) {
      if (entry.levels[k] != kUnknownLevel) known.push_back(k);
    }
    const std::vector<Observation>& observations = entry.track.observations;
    const auto distance = [&](std::size_t k) {
      return (*entry.point_in_world - centers.at(observations[k].frame)).norm();
    };
    const std::vector<std::uint8_t> levels = entry.levels;
    for (std::size_t k = 0; k < levels.size(); ++k) {
      if (levels[k] != kUnknownLevel) continue;
      entry.levels[k] = 0;
      if (known.empty()) continue;
      const auto gap = [&](std::size_t other) {
        return std::abs(observations[other].frame.value - observations[k].frame.value);
      };
      const std::size_t nearest =
          *std::min_element(known.begin(), known.end(), [&](std::size_t a, std::size_t b) {
            return gap(a) < gap(b);
          });
      entry.levels[k] = levels[nearest];
      if (!entry.point_in_world) continue;
      const double nearer = std::log(distance(nearest) / distance(k)) / std::log(map.level_scale);
      entry.levels[k] = static_cast<std::uint8_t>(
          std::lround(std::clamp(levels[nearest] + nearer, 0.0, map.num_levels - 1.0)));
    }
  }
}

// Joins tracks, and finds the pyramid level of each observation.
// @param tracks  as the tracker made them.
void SetTracks(const std::map<FrameId, Features>& features,
               const std::vector<Track>& tracks,
               std::vector<MapTrack> joined,
               RunMap& map) {
  map.tracks = std::move(joined);
  for (MapTrack& entry : map.tracks) entry.levels.assign(entry.fits.size(), kUnknownLevel);
  FindLevels(features, tracks, map);
  GuessUnknownLevels(map);
}

// The verified matches of the view-graph's edges.
ViewGraphMatches MatchesOf(const Orientations& orientations) {
  ViewGraphMatches result;
  std::map<std::pair<FrameId, FrameId>, const EdgeMatches*> of_pair;  // the last ones of each
  for (const EdgeMatches& matches : orientations.edge_matches) {
    if (orientations.graph.FindEdge(matches.frame_i, matches.frame_j) == nullptr) continue;
    of_pair[std::minmax(matches.frame_i, matches.frame_j)] = &matches;
  }
  // Positions, among the keypoints that matches name, of each frame's features; negative for the
  // others.
  std::map<FrameId, std::vector<int>> position;
  const auto positions_of = [&](FrameId frame) -> std::vector<int>& {
    std::vector<int>& of_frame = position[frame];
    if (of_frame.empty()) of_frame.assign(orientations.features.at(frame).keypoints_px.size(), -1);
    return of_frame;
  };
  for (const auto& [pair, matches] : of_pair) {
    std::vector<int>& of_i = positions_of(matches->frame_i);
    std::vector<int>& of_j = positions_of(matches->frame_j);
    for (const auto& [at_i, at_j] : matches->pairs) of_i[at_i] = of_j[at_j] = 0;
  }
  for (auto& [frame, of_frame] : position) {
    const Features& features = orientations.features.at(frame);
    std::vector<Eigen::Vector2f>& keypoints_px = result.keypoints_px[frame];
    for (std::size_t feature = 0; feature < of_frame.size(); ++feature) {
      if (of_frame[feature] < 0) continue;
      of_frame[feature] = static_cast<int>(keypoints_px.size());
      keypoints_px.emplace_back(features.keypoints_px[feature].cast<float>());
    }
  }
  for (const auto& [pair, matches] : of_pair) {
    const bool is_flipped = pair.first != matches->frame_i;
    const std::vector<int>& of_i = position.at(matches->frame_i);
    const std::vector<int>& of_j = position.at(matches->frame_j);
    MatchedPair& matched = result.pairs.emplace_back();
    matched.i = pair.first;
    matched.j = pair.second;
    matched.matches.reserve(matches->pairs.size());
    for (const auto& [at_i, at_j] : matches->pairs) {
      matched.matches.push_back(is_flipped ? std::array{of_j[at_j], of_i[at_i]}
                                           : std::array{of_i[at_i], of_j[at_j]});
    }
  }
  std::erase_if(result.pairs, [](const MatchedPair& pair) { return pair.matches.empty(); });
  return result;
}

}  // namespace

void WriteMaps(const std::filesystem::path& directory,
               const Sequence& sequence,
               const Orientations& orientations,
               const MapResult& positions,
               const FeatureOptions& features) {
  RunMap map;
  map.level_scale = features.scale_factor;
  map.num_levels = features.num_levels;
  map.camera = positions.camera;
  map.image_folder = std::filesystem::absolute(sequence.image_folder()).lexically_normal().string();
  map.is_video = sequence.is_video();
  for (const auto& [frame, cam_from_world] : positions.cam_from_world) {
    map.frames.push_back({frame,
                          orientations.timestamps_s[frame.value],
                          // Frames of a video have numbers; whoever extracts them adds the ending.
                          orientations.image_names[frame.value] + (map.is_video ? ".png" : ""),
                          positions.keyframes.contains(frame),
                          cam_from_world,
                          positions.center_in_world.at(frame)});
  }
  for (const RelativeRotation& edge : orientations.graph.edges()) {
    map.edges.push_back({edge.i, edge.j, edge.num_inliers, edge.rotation_only});
  }
  SetTracks(orientations.features,
            positions.keyframe_tracks,
            JoinTracks(positions.keyframe_tracks, positions.map),
            map);
  WriteRunMap(directory / "map.bin", map);
  SetTracks(orientations.features, positions.cloud.tracks, JoinTracks({}, positions.cloud), map);
  WriteRunMap(directory / "map_all_frames.bin", map);
  WriteThumbnails(directory / "thumbnails.bin",
                  {kThumbnailWidth, kThumbnailHeight, orientations.thumbnails});
  WriteViewGraphMatches(directory / "matches.bin", MatchesOf(orientations));
}

}  // namespace rotslam
