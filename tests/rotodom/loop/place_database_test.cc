#include "rotodom/loop/place_database.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <random>
#include <stdexcept>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace rotslam {
namespace {

// Common words are common: Zipf-like.
BagOfWords RandomBag(int num_words, int num_features, std::mt19937_64& random) {
  std::map<std::uint32_t, int> counts;
  for (int k = 0; k < num_features; ++k) {
    const double uniform = static_cast<double>(random() % 1000000 + 1) / 1000001.0;
    ++counts[static_cast<std::uint32_t>(std::pow(num_words, uniform) - 1.0)];
  }
  BagOfWords bag;
  for (const auto& [word, count] : counts) {
    bag.push_back({word, static_cast<float>(count) / static_cast<float>(num_features)});
  }
  return bag;
}

using BagOf = std::map<FrameId, BagOfWords>;

std::vector<PlaceMatch> BruteForce(const BagOf& frames, const BagOfWords& bag) {
  std::vector<PlaceMatch> matches;
  for (const auto& [frame, other] : frames) {
    int common_words = 0;
    for (const WordWeight& a : bag) {
      common_words += std::any_of(
          other.begin(), other.end(), [&](const WordWeight& b) { return a.word == b.word; });
    }
    if (common_words > 0) matches.push_back({frame, common_words, Score(bag, other)});
  }
  return matches;
}

TEST(PlaceDatabase, AgreesWithBruteForceAsFramesComeAndGo) {
  std::mt19937_64 random(1);
  constexpr int kVocabularySize = 3000;
  PlaceDatabase database(kVocabularySize);
  BagOf frames;
  for (int step = 0; step < 600; ++step) {
    const FrameId frame{static_cast<int>(random() % 5000)};
    if (!frames.contains(frame)) {
      frames[frame] = RandomBag(kVocabularySize, static_cast<int>(random() % 60), random);
      database.Add(frame, frames[frame]);
    }
    // From step 300 on more frames go than come.
    for (int k = 0; k < (step < 300 ? step % 2 : 2) && !frames.empty(); ++k) {
      const auto gone = std::next(frames.begin(), static_cast<int>(random() % frames.size()));
      database.Erase(gone->first);
      frames.erase(gone);
    }
    ASSERT_EQ(database.size(), static_cast<int>(frames.size()));
    if (step % 20 != 0) continue;
    const BagOfWords bag = RandomBag(kVocabularySize, 60, random);
    const std::vector<PlaceMatch> expected = BruteForce(frames, bag);
    const std::vector<PlaceMatch> matches = database.Query(bag);
    ASSERT_EQ(matches.size(), expected.size()) << "step " << step;
    for (std::size_t k = 0; k < matches.size(); ++k) {
      ASSERT_EQ(matches[k].frame, expected[k].frame) << "step " << step;
      ASSERT_EQ(matches[k].common_words, expected[k].common_words) << "step " << step;
      ASSERT_NEAR(matches[k].score, expected[k].score, 1e-6) << "step " << step;
    }
  }
}

TEST(PlaceDatabase, LeavesOutWhatTheCallerExcludes) {
  std::mt19937_64 random(2);
  PlaceDatabase database(100);
  for (int k = 0; k < 10; ++k) database.Add(FrameId{k}, RandomBag(100, 50, random));
  const BagOfWords bag = RandomBag(100, 50, random);
  std::vector<PlaceMatch> expected = database.Query(bag);
  ASSERT_EQ(expected.size(), 10U);
  std::erase_if(expected, [](const PlaceMatch& match) { return match.frame.value % 3 == 0; });
  EXPECT_EQ(database.Query(bag, [](FrameId frame) { return frame.value % 3 == 0; }), expected);
}

TEST(PlaceDatabase, FindsNothingInNothing) {
  PlaceDatabase database(10);
  EXPECT_TRUE(database.Query({{1, 1.0F}}).empty());
  database.Add(FrameId{4}, {});
  database.Add(FrameId{5}, {{1, 1.0F}});
  EXPECT_TRUE(database.Query({}).empty());
  EXPECT_TRUE(database.Query({{2, 1.0F}}).empty());
  EXPECT_TRUE(database.Contains(FrameId{4}));
  EXPECT_FALSE(database.Contains(FrameId{6}));
}

TEST(PlaceDatabase, GivesMemoryBack) {
  std::mt19937_64 random(3);
  PlaceDatabase database(1000);
  const std::size_t empty = database.MemoryBytes();
  for (int k = 0; k < 2000; ++k) database.Add(FrameId{k}, RandomBag(1000, 200, random));
  const std::size_t full = database.MemoryBytes();
  for (int k = 0; k < 1900; ++k) database.Erase(FrameId{k});
  EXPECT_LT(database.MemoryBytes(), full / 4);
  for (int k = 1900; k < 2000; ++k) database.Erase(FrameId{k});
  EXPECT_LT(database.MemoryBytes(), empty + full / 50);
}

// A window that slides for long, as in a run that forgets its oldest frames.
TEST(PlaceDatabase, StaysBoundedWhenFramesAreForgotten) {
  std::mt19937_64 random(4);
  PlaceDatabase database(1000);
  std::size_t largest_early = 0;
  std::size_t largest = 0;
  for (int k = 0; k < 3000; ++k) {
    database.Add(FrameId{k}, RandomBag(1000, 100, random));
    if (k >= 100) database.Erase(FrameId{k - 100});
    largest = std::max(largest, database.MemoryBytes());
    if (k < 1000) largest_early = largest;
  }
  EXPECT_LE(largest, largest_early + largest_early / 4);
}

TEST(PlaceDatabase, RefusesWhatBreaksItsContract) {
  PlaceDatabase database(10);
  database.Add(FrameId{1}, {{3, 1.0F}});
  EXPECT_THROW(database.Add(FrameId{1}, {}), std::invalid_argument);
  EXPECT_THROW(database.Add(FrameId{}, {}), std::invalid_argument);
  EXPECT_THROW(database.Add(FrameId{2}, {{10, 1.0F}}), std::invalid_argument);
  EXPECT_THROW(database.Add(FrameId{2}, {{4, 0.5F}, {4, 0.5F}}), std::invalid_argument);
  EXPECT_THROW(database.Add(FrameId{2}, {{4, std::nanf("")}}), std::invalid_argument);
  EXPECT_THROW(database.Query({{10, 1.0F}}), std::invalid_argument);
  EXPECT_THROW(database.Erase(FrameId{2}), std::invalid_argument);
  EXPECT_THROW(PlaceDatabase(-1), std::invalid_argument);
  EXPECT_EQ(database.size(), 1);
}

TEST(WithManyCommonWords, KeepsThoseNearTheMost) {
  const std::vector<PlaceMatch> matches = {
      {FrameId{1}, 80, 0.1}, {FrameId{2}, 100, 0.2}, {FrameId{3}, 81, 0.05}, {FrameId{4}, 3, 0.9}};
  EXPECT_THAT(WithManyCommonWords(matches, 0.8), testing::ElementsAre(matches[1], matches[2]));
  EXPECT_EQ(WithManyCommonWords(matches, 0.0), matches);
  EXPECT_TRUE(WithManyCommonWords({}, 0.8).empty());
  EXPECT_THROW(WithManyCommonWords(matches, 1.5), std::invalid_argument);
}

}  // namespace
}  // namespace rotslam
