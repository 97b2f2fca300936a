#include "apps/paper_method/window_matching.h"

#include <array>
#include <vector>

#include <gtest/gtest.h>

#include "rotodom/types/splitmix64.h"

namespace rotslam {
namespace {

MatchingOptions PaperMatching() {
  MatchingOptions options;
  options.radius_px = 100.0;
  options.max_distance = 50;
  options.ratio = 0.9;
  return options;
}

BinaryDescriptor RandomDescriptor(SplitMix64& random) {
  return {random.Next(), random.Next(), random.Next(), random.Next()};
}

// Features with random descriptors at random places.
OrbView RandomView(int count, std::uint64_t seed) {
  SplitMix64 random(seed);
  OrbView view;
  for (int k = 0; k < count; ++k) {
    view.keypoints_px.emplace_back(random.Index(600), random.Index(300));
    view.bearings.push_back(Eigen::Vector3d::UnitZ());
    view.levels.push_back(random.Index(8));
    view.angles_rad.push_back(0.01F * static_cast<float>(random.Index(600)));
    view.descriptors.push_back(RandomDescriptor(random));
  }
  return view;
}

OrbView Moved(OrbView view, double x_px) {
  for (Eigen::Vector2d& keypoint : view.keypoints_px) keypoint.x() += x_px;
  return view;
}

TEST(MatchInWindow, FindsWhatHasMovedLessThanTheRadius) {
  const OrbView view = RandomView(500, 1);
  const auto pairs = MatchInWindow(view, Moved(view, 80.0), PaperMatching());
  EXPECT_EQ(pairs.size(), 500U);
  for (const auto& [i, j] : pairs) EXPECT_EQ(i, j);
  EXPECT_TRUE(MatchInWindow(view, Moved(view, 700.0), PaperMatching()).empty());
}

TEST(MatchInWindow, RefusesDistantAmbiguousAndRescaledFeatures) {
  OrbView i = RandomView(3, 2);
  i.keypoints_px = {{100, 100}, {120, 100}, {140, 100}};
  i.levels = {2, 2, 2};
  OrbView j = i;
  j.descriptors[0][0] ^= 0xFFFFFFFFFFFFFFFFull;  // 64 bits
  i.descriptors[1] = i.descriptors[2];           // a twin
  j.descriptors[1] = i.descriptors[2];
  j.levels[2] = 5;
  EXPECT_TRUE(MatchInWindow(i, j, PaperMatching()).empty());
}

TEST(MatchInWindow, GivesAFeatureToTheNearestThatWantsIt) {
  OrbView i = RandomView(1, 3);
  OrbView j = RandomView(2, 3);
  j.keypoints_px = {i.keypoints_px[0], i.keypoints_px[0]};
  j.levels = {i.levels[0], i.levels[0]};
  j.descriptors = {i.descriptors[0], i.descriptors[0]};
  j.descriptors[0][1] ^= 0xFF;
  using Pairs = std::vector<std::array<int, 2>>;
  EXPECT_EQ(MatchInWindow(i, j, PaperMatching()), (Pairs{{0, 1}}));
}

TEST(MatchInWindow, TakesEmptyViews) {
  const OrbView view = RandomView(10, 4);
  EXPECT_TRUE(MatchInWindow({}, view, PaperMatching()).empty());
  EXPECT_TRUE(MatchInWindow(view, {}, PaperMatching()).empty());
}

TEST(MatchByWords, MatchesWithinNodesAndDropsRareTurns) {
  const int count = 60;
  OrbView i = RandomView(count, 5);
  OrbView j = Moved(i, 400.0);
  DirectIndex words;
  words.nodes = {4, 9};
  words.starts = {0, count / 2, count};
  for (int k = 0; k < count; ++k) words.features.push_back(static_cast<std::uint16_t>(k));
  EXPECT_EQ(MatchByWords(i, words, j, words, PaperMatching()).size(),
            static_cast<std::size_t>(count));
  // One patch that has rotated while the others have not.
  j.angles_rad[7] += 2.0F;
  EXPECT_EQ(MatchByWords(i, words, j, words, PaperMatching()).size(),
            static_cast<std::size_t>(count - 1));
  DirectIndex others = words;
  others.nodes = {5, 9};
  EXPECT_LE(MatchByWords(i, words, j, others, PaperMatching()).size(),
            static_cast<std::size_t>(count / 2));
}

}  // namespace
}  // namespace rotslam
