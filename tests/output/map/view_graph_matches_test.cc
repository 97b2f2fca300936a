#include "output/map/view_graph_matches.h"

#include <cstdint>
#include <random>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/output/scene_map.h"
#include "tests/output/temporary_folder.h"

namespace rotslam {
namespace {

using testing::HasSubstr;

// Three frames; pairs as of tracked points (runs with gaps), as of a loop (no order), and of one.
ViewGraphMatches SomeMatches() {
  ViewGraphMatches matches;
  for (const int frame : {3, 4, 90}) {
    for (int k = 0; k < 300; ++k) {
      matches.keypoints_px[FrameId{frame}].emplace_back(0.1F * static_cast<float>(k), -1.5F);
    }
  }
  MatchedPair tracked{FrameId{3}, FrameId{4}, {}};
  for (int k = 0; k < 290; ++k) {
    if (k % 17 != 0) tracked.matches.push_back({k, k + 10 - k / 50});
  }
  MatchedPair loop{FrameId{3}, FrameId{90}, {{299, 0}, {5, 299}, {6, 7}, {0, 128}}};
  matches.pairs = {tracked, loop, {FrameId{4}, FrameId{90}, {{0, 0}}}};
  return matches;
}

TEST(ViewGraphMatches, ReadBackTheSame) {
  const TemporaryFolder folder;
  const ViewGraphMatches matches = SomeMatches();
  WriteViewGraphMatches(folder.path() / "matches.bin", matches);
  const ViewGraphMatches read = ReadViewGraphMatches(folder.path() / "matches.bin");
  EXPECT_EQ(read.keypoints_px, matches.keypoints_px);
  ASSERT_EQ(read.pairs.size(), matches.pairs.size());
  for (std::size_t k = 0; k < read.pairs.size(); ++k) {
    EXPECT_EQ(read.pairs[k].i, matches.pairs[k].i);
    EXPECT_EQ(read.pairs[k].j, matches.pairs[k].j);
    EXPECT_EQ(read.pairs[k].matches, matches.pairs[k].matches);
  }
}

TEST(ViewGraphMatches, RefuseDamagedFilesInOneLine) {
  const TemporaryFolder folder;
  const auto file = folder.path() / "matches.bin";
  WriteViewGraphMatches(file, SomeMatches());
  const std::string whole = ReadWholeFile(file);
  folder.Write("matches.bin", "no matches at all, but long enough");
  EXPECT_THAT(RuntimeErrorOf([&] { ReadViewGraphMatches(file); }), HasSubstr("is not a list"));
  for (std::size_t size = whole.size() - 1; size > whole.size() - 200; --size) {
    folder.Write("matches.bin", whole.substr(0, size));
    EXPECT_THAT(RuntimeErrorOf([&] { ReadViewGraphMatches(file); }), HasSubstr("matches.bin: "));
  }
  std::mt19937 random(1);
  for (int round = 0; round < 2000; ++round) {
    std::string damaged = whole;
    const auto place = random() % 400;
    damaged[damaged.size() - 1 - place] = static_cast<char>(random());
    folder.Write("matches.bin", damaged);
    try {
      const ViewGraphMatches read = ReadViewGraphMatches(file);
      for (const MatchedPair& pair : read.pairs) {
        for (const auto& [i, j] : pair.matches) {
          ASSERT_LT(static_cast<std::size_t>(i), read.keypoints_px.at(pair.i).size());
          ASSERT_LT(static_cast<std::size_t>(j), read.keypoints_px.at(pair.j).size());
        }
      }
    } catch (const std::runtime_error& error) {
      EXPECT_THAT(error.what(), HasSubstr("matches.bin: "));
    }
  }
}

TEST(ViewGraphMatches, AddTheKeypointsThatNoTrackHas) {
  RunMap map = MapOfScene(ExportScene());
  const std::size_t num_tracks = map.tracks.size();
  const Observation known = map.tracks[0].track.observations[0];
  ViewGraphMatches matches;
  matches.keypoints_px[known.frame] = {known.keypoint_px.cast<float>(), {11.5F, 12.25F}};
  matches.keypoints_px[FrameId{5}] = {{1.0F, 2.0F}};  // a frame that the map does not have
  AddKeypoints(matches, map);
  ASSERT_EQ(map.tracks.size(), num_tracks + 1);
  const MapTrack& added = map.tracks.back();
  EXPECT_LT(map.tracks[num_tracks - 1].track.id, added.track.id);
  EXPECT_FALSE(added.point_in_world.has_value());
  ASSERT_EQ(added.track.observations.size(), 1u);
  EXPECT_EQ(added.track.observations[0].keypoint_px, Eigen::Vector2d(11.5, 12.25));
  AddKeypoints(matches, map);
  EXPECT_EQ(map.tracks.size(), num_tracks + 1);
}

}  // namespace
}  // namespace rotslam
