#include "apps/cli/run_directory/map_files.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <iterator>
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

// A feature's place and pyramid level; in the order of the places.
struct PlacedLevel {
  double x;
  double y;
  int level;
};

std::vector<PlacedLevel> LevelsByPlace(const Features& features) {
  std::vector<PlacedLevel> levels;
  levels.reserve(features.keypoints_px.size());
  for (int k = 0; k < features.size(); ++k) {
    const Eigen::Vector2d& keypoint_px = features.keypoints_px[k];
    levels.push_back({keypoint_px.x(), keypoint_px.y(), features.levels[k]});
  }
  // Of two features in one place the last one counts.
  std::stable_sort(levels.begin(), levels.end(), [](const PlacedLevel& a, const PlacedLevel& b) {
    return std::pair(a.x, a.y) < std::pair(b.x, b.y);
  });
  return levels;
}

// Level of the feature at this place, to the last bit; null: there is none.
const PlacedLevel* LevelAt(const std::vector<PlacedLevel>& levels, const Eigen::Vector2d& px) {
  const auto after = std::upper_bound(
      levels.begin(), levels.end(), px, [](const Eigen::Vector2d& at, const PlacedLevel& level) {
        return std::pair(at.x(), at.y()) < std::pair(level.x, level.y);
      });
  if (after == levels.begin()) return nullptr;
  const PlacedLevel& found = *std::prev(after);
  return found.x == px.x() && found.y == px.y() ? &found : nullptr;
}

// The map's observation of a track in a frame; null: there is none.
std::uint8_t* FindLevelOf(TrackId id, FrameId frame, RunMap& map) {
  const auto entry = std::lower_bound(
      map.tracks.begin(), map.tracks.end(), id, [](const MapTrack& track, TrackId wanted) {
        return track.track.id < wanted;
      });
  if (entry == map.tracks.end() || entry->track.id != id) return nullptr;
  const std::vector<Observation>& observations = entry->track.observations;
  const auto seen = std::lower_bound(
      observations.begin(), observations.end(), frame, [](const Observation& one, FrameId wanted) {
        return one.frame < wanted;
      });
  if (seen == observations.end() || seen->frame != frame) return nullptr;
  return &entry->levels[static_cast<std::size_t>(seen - observations.begin())];
}

// Gives each sighting of a track that is in the map the level of its frame's feature whose
// keypoint it is to the last bit.
// @param track_at  track number k of `num_tracks`.
template <class TrackAt>
void FindLevels(const std::map<FrameId, Features>& features,
                std::size_t num_tracks,
                const TrackAt& track_at,
                RunMap& map) {
  std::map<FrameId, std::vector<ObservationIndex>> sightings;
  for (std::size_t t = 0; t < num_tracks; ++t) {
    const std::vector<Observation>& observations = track_at(t).observations;
    for (std::size_t k = 0; k < observations.size(); ++k) {
      sightings[observations[k].frame].push_back({static_cast<int>(t), static_cast<int>(k)});
    }
  }
  for (const auto& [frame, of_frame] : sightings) {
    const auto found = features.find(frame);
    if (found == features.end()) continue;
    const std::vector<PlacedLevel> levels = LevelsByPlace(found->second);
    for (const auto& [t, k] : of_frame) {
      const Track& track = track_at(static_cast<std::size_t>(t));
      const PlacedLevel* level = LevelAt(levels, track.observations[k].keypoint_px);
      if (level == nullptr) continue;
      std::uint8_t* const of_sighting = FindLevelOf(track.id, frame, map);
      if (of_sighting != nullptr) *of_sighting = static_cast<std::uint8_t>(level->level);
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
    if (known.size() == entry.levels.size()) continue;
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

// The tracks with a point, which the reconstruction loses: JoinTracks in the same memory.
std::vector<MapTrack> TakeTracks(Reconstruction& solved) {
  std::vector<MapTrack> list;
  list.reserve(solved.tracks.size());
  for (Track& track : solved.tracks) {
    const auto point = solved.point_in_world.find(track.id);
    if (point == solved.point_in_world.end()) continue;
    MapTrack& entry = list.emplace_back();
    entry.track = std::move(track);
    entry.point_in_world = point->second;
    entry.fits.assign(entry.track.observations.size(), true);
  }
  solved.tracks = {};
  std::sort(list.begin(), list.end(), [](const MapTrack& a, const MapTrack& b) {
    return a.track.id < b.track.id;
  });
  return list;
}

// Levels that no sighting has told yet.
void ForgetLevels(RunMap& map) {
  for (MapTrack& entry : map.tracks) entry.levels.assign(entry.fits.size(), kUnknownLevel);
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
               MapResult& positions,
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
  // Bundle adjustment may have found other keypoints than the tracker.
  const std::vector<Track>& tracked = positions.keyframe_tracks;
  map.tracks = JoinTracks(tracked, positions.map);
  ForgetLevels(map);
  FindLevels(
      orientations.features,
      tracked.size(),
      [&](std::size_t k) -> const Track& { return tracked[k]; },
      map);
  GuessUnknownLevels(map);
  WriteRunMap(directory / "map.bin", map);
  map.tracks = TakeTracks(positions.cloud);
  ForgetLevels(map);
  FindLevels(
      orientations.features,
      map.tracks.size(),
      [&](std::size_t k) -> const Track& { return map.tracks[k].track; },
      map);
  GuessUnknownLevels(map);
  WriteRunMap(directory / "map_all_frames.bin", map);
  map.tracks.clear();
  WriteThumbnails(directory / "thumbnails.bin",
                  {kThumbnailWidth, kThumbnailHeight, orientations.thumbnails});
  WriteViewGraphMatches(directory / "matches.bin", MatchesOf(orientations));
}

}  // namespace rotslam
