#include "output/map/view_graph_matches.h"

#include <cstdint>
#include <set>
#include <string>
#include <string_view>
#include <utility>

#include "output/files/atomic_file.h"
#include "output/files/binary_file.h"

namespace rotslam {
namespace {

constexpr std::string_view kMatchesMagic = "rotslam_matches 1\n";

// Seven bits a byte, the lowest first; the highest bit says that more follow.
void PutVarint(BinaryWriter& writer, std::uint32_t value) {
  for (; value >= 0x80U; value >>= 7U) writer.Put(static_cast<std::uint8_t>(value | 0x80U));
  writer.Put(static_cast<std::uint8_t>(value));
}

std::uint32_t GetVarint(BinaryReader& reader) {
  std::uint32_t value = 0;
  for (unsigned shift = 0; shift < 32; shift += 7) {
    const auto byte = reader.Get<std::uint8_t>();
    value |= (byte & 0x7FU) << shift;
    if ((byte & 0x80U) == 0) return value;
  }
  reader.Fail("a number does not end");
}

// Signs go to the lowest bit, so that small steps either way take one byte.
std::uint32_t Zigzag(std::int32_t value) {
  return (static_cast<std::uint32_t>(value) << 1U) ^ static_cast<std::uint32_t>(value >> 31);
}
std::int32_t Unzigzag(std::uint32_t value) {
  return static_cast<std::int32_t>(value >> 1U) ^ -static_cast<std::int32_t>(value & 1U);
}

// Runs of matches in which both positions grow by one: where they begin, as steps from the match
// that would have gone on with the run before, and their lengths.
void PutMatches(BinaryWriter& writer, const std::vector<std::array<int, 2>>& matches) {
  writer.Put(static_cast<std::uint32_t>(matches.size()));
  std::array<int, 2> next = {0, 0};
  for (std::size_t k = 0; k < matches.size();) {
    for (int side = 0; side < 2; ++side) PutVarint(writer, Zigzag(matches[k][side] - next[side]));
    next = matches[k];
    std::uint32_t length = 0;
    for (; k < matches.size() && matches[k] == next; ++k, ++length) {
      for (int& position : next) ++position;
    }
    PutVarint(writer, length);
  }
}

std::vector<std::array<int, 2>> GetMatches(BinaryReader& reader,
                                           const std::array<std::size_t, 2>& num_keypoints) {
  const auto count = reader.Get<std::uint32_t>();
  // One keypoint of i has one match in j.
  if (count > num_keypoints[0]) reader.Fail("a pair has more matches than keypoints");
  std::vector<std::array<int, 2>> matches;
  matches.reserve(count);
  std::array<int, 2> next = {0, 0};
  while (matches.size() < count) {
    for (int side = 0; side < 2; ++side) {
      const std::int64_t position = std::int64_t{next[side]} + Unzigzag(GetVarint(reader));
      if (position < 0 || position >= static_cast<std::int64_t>(num_keypoints[side])) {
        reader.Fail("a match names a keypoint that there is not");
      }
      next[side] = static_cast<int>(position);
    }
    const std::uint32_t length = GetVarint(reader);
    for (int side = 0; side < 2; ++side) {
      if (length == 0 || length > num_keypoints[side] - static_cast<std::size_t>(next[side])) {
        reader.Fail("a run of matches is too long");
      }
    }
    if (length > count - matches.size()) reader.Fail("a run of matches is too long");
    for (std::uint32_t k = 0; k < length; ++k) {
      matches.push_back(next);
      for (int& position : next) ++position;
    }
  }
  return matches;
}

}  // namespace

void WriteViewGraphMatches(const std::filesystem::path& path, const ViewGraphMatches& matches) {
  BinaryWriter writer;
  for (const char c : kMatchesMagic) writer.Put(c);
  writer.Put(static_cast<std::uint64_t>(matches.keypoints_px.size()));
  for (const auto& [frame, keypoints_px] : matches.keypoints_px) {
    writer.Put(static_cast<std::int32_t>(frame.value));
    writer.Put(static_cast<std::uint64_t>(keypoints_px.size()));
    for (const Eigen::Vector2f& keypoint_px : keypoints_px) {
      writer.Put(keypoint_px.x());
      writer.Put(keypoint_px.y());
    }
  }
  writer.Put(static_cast<std::uint64_t>(matches.pairs.size()));
  for (const MatchedPair& pair : matches.pairs) {
    writer.Put(static_cast<std::int32_t>(pair.i.value));
    writer.Put(static_cast<std::int32_t>(pair.j.value));
    PutMatches(writer, pair.matches);
  }
  ReplaceFile(path, writer.bytes());
}

ViewGraphMatches ReadViewGraphMatches(const std::filesystem::path& path) {
  BinaryReader reader(path);
  if (reader.Take(kMatchesMagic.size()) != kMatchesMagic) {
    reader.Fail("is not a list of matches that this version of `rotslam run` writes");
  }
  ViewGraphMatches matches;
  for (auto left = reader.Count("frames", 12); left > 0; --left) {
    const FrameId frame{reader.Get<std::int32_t>()};
    std::vector<Eigen::Vector2f>& keypoints_px = matches.keypoints_px[frame];
    keypoints_px.resize(reader.Count("keypoints", 8));
    for (Eigen::Vector2f& keypoint_px : keypoints_px) {
      keypoint_px.x() = reader.Get<float>();
      keypoint_px.y() = reader.Get<float>();
      if (!keypoint_px.allFinite()) reader.Fail("a keypoint is not finite");
    }
  }
  for (auto left = reader.Count("pairs", 12); left > 0; --left) {
    MatchedPair& pair = matches.pairs.emplace_back();
    pair.i = FrameId{reader.Get<std::int32_t>()};
    pair.j = FrameId{reader.Get<std::int32_t>()};
    const auto of_i = matches.keypoints_px.find(pair.i);
    const auto of_j = matches.keypoints_px.find(pair.j);
    const bool is_known = of_i != matches.keypoints_px.end() && of_j != matches.keypoints_px.end();
    if (!is_known || !(pair.i < pair.j)) reader.Fail("a pair of frames is not one");
    pair.matches = GetMatches(reader, {of_i->second.size(), of_j->second.size()});
  }
  reader.ExpectEnd();
  return matches;
}

void AddKeypoints(const ViewGraphMatches& matches, RunMap& map) {
  using Pixel = std::pair<float, float>;
  std::map<FrameId, std::set<Pixel>> known;
  for (const MapFrame& frame : map.frames) known[frame.id];
  for (const MapTrack& entry : map.tracks) {
    for (const Observation& seen : entry.track.observations) {
      const Eigen::Vector2f keypoint_px = seen.keypoint_px.cast<float>();
      known[seen.frame].emplace(keypoint_px.x(), keypoint_px.y());
    }
  }
  int next_id = map.tracks.empty() ? 0 : map.tracks.back().track.id.value + 1;
  for (const auto& [frame, keypoints_px] : matches.keypoints_px) {
    const auto of_frame = known.find(frame);
    if (of_frame == known.end()) continue;
    for (const Eigen::Vector2f& keypoint_px : keypoints_px) {
      if (!of_frame->second.emplace(keypoint_px.x(), keypoint_px.y()).second) continue;
      const Eigen::Vector2d pixel = keypoint_px.cast<double>();
      const auto bearing = map.camera.Unproject(pixel);
      if (!bearing) continue;
      MapTrack& entry = map.tracks.emplace_back();
      entry.track.id = TrackId{next_id++};
      entry.track.observations.push_back({frame, pixel, *bearing, 1.0});
      entry.fits.push_back(false);
      entry.levels.push_back(0);
    }
  }
}

}  // namespace rotslam
