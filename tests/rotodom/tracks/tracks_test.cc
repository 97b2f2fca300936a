#include "rotodom/tracks/tracks.h"

#include <set>
#include <stdexcept>

#include <gtest/gtest.h>

namespace rotslam {
namespace {

// Keypoint k of frame f lies at (k, f) and has the colour (f, k, 0), so that a track tells where it
// comes from.
std::map<FrameId, Features> MakeFeatures(int num_frames, int num_keypoints) {
  std::map<FrameId, Features> features;
  for (int f = 0; f < num_frames; ++f) {
    Features& of_frame = features[FrameId{f}];
    of_frame.frame = FrameId{f};
    for (int k = 0; k < num_keypoints; ++k) {
      of_frame.keypoints_px.emplace_back(k, f);
      of_frame.bearings.push_back(Eigen::Vector3d(0.01 * k, 0.01 * f, 1.0).normalized());
      of_frame.rgb.push_back({static_cast<std::uint8_t>(f), static_cast<std::uint8_t>(k), 0});
    }
  }
  return features;
}

std::set<FrameId> Frames(int count) {
  std::set<FrameId> frames;
  for (int f = 0; f < count; ++f) frames.insert(FrameId{f});
  return frames;
}

EdgeMatches Edge(int i, int j, std::vector<std::array<int, 2>> pairs) {
  return {FrameId{i}, FrameId{j}, std::move(pairs)};
}

// The keypoints of a track as (frame, keypoint).
std::vector<std::array<int, 2>> Members(const Track& track) {
  std::vector<std::array<int, 2>> members;
  for (const Observation& observation : track.observations) {
    members.push_back({observation.frame.value, static_cast<int>(observation.keypoint_px.x())});
  }
  return members;
}

using MemberList = std::vector<std::array<int, 2>>;

TEST(BuildTracks, JoinsTransitively) {
  const auto features = MakeFeatures(4, 5);
  const auto tracks = BuildTracks(
      {Edge(0, 1, {{1, 2}}), Edge(2, 3, {{3, 4}}), Edge(1, 2, {{2, 3}})}, features, Frames(4), 2);
  ASSERT_EQ(tracks.size(), 1u);
  EXPECT_EQ(Members(tracks[0]), (MemberList{{0, 1}, {1, 2}, {2, 3}, {3, 4}}));
  EXPECT_EQ(tracks[0].id, TrackId{0});
  EXPECT_EQ(tracks[0].rgb, (std::array<std::uint8_t, 3>{0, 1, 0}));  // of its first sighting
  for (const Observation& observation : tracks[0].observations) {
    const Features& of_frame = features.at(observation.frame);
    const int k = static_cast<int>(observation.keypoint_px.x());
    EXPECT_EQ(observation.keypoint_px, of_frame.keypoints_px[k]);
    EXPECT_EQ(observation.bearing, of_frame.bearings[k]);
  }
}

TEST(BuildTracks, TheEarlierEdgeWinsAConflict) {
  const auto features = MakeFeatures(3, 3);
  const EdgeMatches first = Edge(0, 1, {{0, 0}});
  const EdgeMatches second = Edge(1, 2, {{0, 0}});
  const EdgeMatches contrary = Edge(0, 2, {{1, 0}});  // would put 0 and 1 of frame 0 together
  const auto trusted_last = BuildTracks({first, second, contrary}, features, Frames(3), 2);
  ASSERT_EQ(trusted_last.size(), 1u);
  EXPECT_EQ(Members(trusted_last[0]), (MemberList{{0, 0}, {1, 0}, {2, 0}}));
  const auto trusted_first = BuildTracks({contrary, first, second}, features, Frames(3), 2);
  ASSERT_EQ(trusted_first.size(), 2u);
  EXPECT_EQ(Members(trusted_first[0]), (MemberList{{0, 0}, {1, 0}}));
  EXPECT_EQ(Members(trusted_first[1]), (MemberList{{0, 1}, {2, 0}}));
}

TEST(BuildTracks, NeverTwoKeypointsOfOneFrame) {
  // Every third keypoint is matched wrongly, so nearly all would grow into one.
  const int num_frames = 12;
  const int num_keypoints = 40;
  const auto features = MakeFeatures(num_frames, num_keypoints);
  std::vector<EdgeMatches> edges;
  for (int i = 0; i < num_frames; ++i) {
    for (int j = i + 1; j < std::min(num_frames, i + 4); ++j) {
      EdgeMatches edge = Edge(i, j, {});
      for (int k = 0; k < num_keypoints; ++k) {
        edge.pairs.push_back({k, (k + i + j) % 3 == 0 ? (k + j) % num_keypoints : k});
      }
      edges.push_back(edge);
    }
  }
  std::set<std::array<int, 2>> seen;
  for (const Track& track : BuildTracks(edges, features, Frames(num_frames), 2)) {
    for (std::size_t n = 0; n < track.observations.size(); ++n) {
      if (n > 0) {
        EXPECT_GT(track.observations[n].frame, track.observations[n - 1].frame);
      }
    }
    for (const auto& member : Members(track)) EXPECT_TRUE(seen.insert(member).second);
  }
  EXPECT_GT(seen.size(), 400u);
}

TEST(BuildTracks, LeavesOutShortOnes) {
  const auto features = MakeFeatures(3, 4);
  const std::vector<EdgeMatches> edges = {Edge(0, 1, {{0, 0}, {1, 1}, {2, 2}}),
                                          Edge(1, 2, {{1, 1}})};
  const auto count = [&](int min_length) {
    return BuildTracks(edges, features, Frames(3), min_length).size();
  };
  EXPECT_EQ(count(1), 8u);  // keypoints without a match count as well: 3 * 4 less 4 joined
  EXPECT_EQ(count(2), 3u);
  EXPECT_EQ(count(3), 1u);
  EXPECT_EQ(count(4), 0u);
}

TEST(BuildTracks, ObservesInTheGivenFramesAlone) {
  const auto features = MakeFeatures(4, 4);
  const std::vector<EdgeMatches> edges = {
      Edge(0, 1, {{0, 0}}), Edge(1, 2, {{0, 0}}), Edge(2, 3, {{0, 0}})};
  const auto tracks = BuildTracks(edges, features, {FrameId{0}, FrameId{3}}, 2);
  ASSERT_EQ(tracks.size(), 1u);
  EXPECT_EQ(Members(tracks[0]), (MemberList{{0, 0}, {3, 0}}));  // joined through frames 1 and 2
  EXPECT_TRUE(BuildTracks(edges, features, {FrameId{1}}, 2).empty());
}

TEST(BuildTracks, IdsAreConsecutiveInOrderOfFirstSighting) {
  const auto features = MakeFeatures(3, 6);
  const auto tracks = BuildTracks(
      {Edge(1, 2, {{3, 0}, {1, 4}}), Edge(0, 2, {{5, 5}}), Edge(0, 1, {{2, 2}, {4, 5}})},
      features,
      Frames(3),
      2);
  ASSERT_EQ(tracks.size(), 5u);
  MemberList first_members;
  for (std::size_t k = 0; k < tracks.size(); ++k) {
    EXPECT_EQ(tracks[k].id.value, static_cast<int>(k));
    first_members.push_back(Members(tracks[k]).front());
  }
  EXPECT_EQ(first_members, (MemberList{{0, 2}, {0, 4}, {0, 5}, {1, 1}, {1, 3}}));
}

TEST(BuildTracks, NothingGivesNothing) {
  EXPECT_TRUE(BuildTracks({}, {}, {}, 2).empty());
  EXPECT_TRUE(BuildTracks({}, MakeFeatures(2, 3), Frames(2), 2).empty());
  EXPECT_TRUE(BuildTracks({Edge(0, 1, {})}, MakeFeatures(2, 0), Frames(2), 1).empty());
}

TEST(BuildTracks, RejectsABrokenContract) {
  const auto features = MakeFeatures(2, 3);
  EXPECT_THROW(BuildTracks({Edge(0, 7, {{0, 0}})}, features, Frames(2), 2), std::invalid_argument);
  EXPECT_THROW(BuildTracks({Edge(0, 1, {{3, 0}})}, features, Frames(2), 2), std::invalid_argument);
  EXPECT_THROW(BuildTracks({Edge(0, 1, {{0, -1}})}, features, Frames(2), 2), std::invalid_argument);
}

}  // namespace
}  // namespace rotslam
