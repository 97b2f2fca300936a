#include "rotodom/loop/candidates.h"

#include <cmath>
#include <stdexcept>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace rotslam {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

constexpr int kNumWords = 2000;
constexpr int kBagSize = 100;

// Words first, first + 1 ..., all alike: the score of two bags is the share of common words.
BagOfWords Bag(int first) {
  BagOfWords bag;
  for (int k = 0; k < kBagSize; ++k) {
    bag.push_back({static_cast<std::uint32_t>(first + k), 1.0F / kBagSize});
  }
  return bag;
}

// The first words of Bag(0), the others from where no other bag is.
BagOfWords LikeBagZero(int num_common) {
  BagOfWords bag = Bag(0);
  for (int k = num_common; k < kBagSize; ++k) bag[k].word += 1000;
  return bag;
}

std::vector<FrameId> Frames(const std::vector<int>& numbers) {
  std::vector<FrameId> frames;
  frames.reserve(numbers.size());
  for (const int number : numbers) frames.push_back(FrameId{number});
  return frames;
}

std::vector<LoopCandidate> Add(CandidateFinder& finder,
                               int frame,
                               const BagOfWords& bag,
                               const std::vector<int>& neighbours = {}) {
  return finder.AddPlace(FrameId{frame}, bag, Frames(neighbours));
}

std::vector<FrameId> FramesOf(const std::vector<LoopCandidate>& candidates) {
  std::vector<FrameId> frames;
  frames.reserve(candidates.size());
  for (const LoopCandidate& candidate : candidates) frames.push_back(candidate.frame);
  return frames;
}

TEST(CandidateFinder, FindsTheOldPlace) {
  CandidateFinder finder(kNumWords, {});
  EXPECT_THAT(Add(finder, 0, Bag(0)), IsEmpty());
  EXPECT_THAT(Add(finder, 20, Bag(100)), IsEmpty());
  EXPECT_THAT(Add(finder, 40, Bag(200)), IsEmpty());
  // Ten words are those of place 20, ninety those of place 0.
  const std::vector<LoopCandidate> candidates = Add(finder, 60, Bag(10));
  ASSERT_THAT(FramesOf(candidates), ElementsAre(FrameId{0}));
  EXPECT_NEAR(candidates[0].score, 0.9, 1e-5);
  EXPECT_NEAR(candidates[0].group_score, 0.9, 1e-5);
  EXPECT_EQ(candidates[0].num_consistent, 1);
}

TEST(CandidateFinder, LeavesOutPlacesWithFewCommonWords) {
  for (const double ratio : {0.8, 0.0}) {
    CandidateOptions options;
    options.common_words_ratio = ratio;
    options.group_score_ratio = 0.0;
    CandidateFinder finder(kNumWords, options);
    Add(finder, 0, LikeBagZero(90));
    Add(finder, 1, LikeBagZero(80));
    Add(finder, 2, LikeBagZero(70));
    const std::vector<FrameId> found = FramesOf(Add(finder, 50, Bag(0)));
    EXPECT_EQ(found, ratio > 0.0 ? Frames({0, 1}) : Frames({0, 1, 2}));
  }
}

TEST(CandidateFinder, RecentFramesAreNoLoops) {
  for (const int recent_frames : {0, 10, 100}) {
    CandidateOptions options;
    options.recent_frames = recent_frames;
    CandidateFinder finder(kNumWords, options);
    Add(finder, 0, Bag(0));
    if (recent_frames > 1) {
      EXPECT_THAT(Add(finder, recent_frames - 1, Bag(0)), IsEmpty()) << recent_frames;
    }
    EXPECT_THAT(FramesOf(Add(finder, recent_frames + 1, Bag(0))), ElementsAre(FrameId{0}))
        << recent_frames;
  }
}

TEST(CandidateFinder, NeighboursAreNoLoops) {
  CandidateFinder finder(kNumWords, {});
  Add(finder, 0, Bag(0));
  EXPECT_THAT(Add(finder, 50, Bag(0), {0}), IsEmpty());
  EXPECT_THAT(FramesOf(Add(finder, 100, Bag(0), {50})), ElementsAre(FrameId{0}));
}

TEST(CandidateFinder, AsksForWhatNeighboursScore) {
  // The old place scores 0.6.
  const auto find = [](const std::vector<int>& neighbours_percent) {
    CandidateFinder finder(kNumWords, {});
    Add(finder, 0, LikeBagZero(60));
    std::vector<int> neighbours;
    for (const int percent : neighbours_percent) {
      neighbours.push_back(41 + static_cast<int>(neighbours.size()));
      Add(finder, neighbours.back(), LikeBagZero(percent));
    }
    return FramesOf(Add(finder, 50, Bag(0), neighbours));
  };
  EXPECT_THAT(find({}), ElementsAre(FrameId{0}));
  EXPECT_THAT(find({50}), ElementsAre(FrameId{0}));
  EXPECT_THAT(find({70}), IsEmpty());
  EXPECT_THAT(find({70, 80}), IsEmpty());
  // The least of them counts.
  EXPECT_THAT(find({70, 50}), ElementsAre(FrameId{0}));
  EXPECT_THAT(find({50, 70}), ElementsAre(FrameId{0}));
}

TEST(CandidateFinder, NeighboursWithoutCommonWordsScoreNothing) {
  for (const std::vector<int>& neighbours : {std::vector<int>{40, 41}, std::vector<int>{41}}) {
    CandidateFinder finder(kNumWords, {});
    Add(finder, 0, LikeBagZero(60));
    Add(finder, 40, LikeBagZero(80));
    Add(finder, 41, Bag(500));
    EXPECT_THAT(FramesOf(Add(finder, 49, Bag(0), neighbours)), ElementsAre(FrameId{0}))
        << neighbours.size() << " neighbours";
  }
}

// Places 0 to 3 around place 1, that score 0.4, 0.6, 0.5 and 0.3, and place 4 by itself.
CandidateFinder GroupAndLoner(const CandidateOptions& options, int loner_percent) {
  CandidateFinder finder(kNumWords, options);
  Add(finder, 0, LikeBagZero(40));
  Add(finder, 1, LikeBagZero(60), {0});
  Add(finder, 2, LikeBagZero(50), {1, 0});
  Add(finder, 3, LikeBagZero(30), {1});
  Add(finder, 4, LikeBagZero(loner_percent));
  return finder;
}

CandidateOptions AnyNumberOfWords() {
  CandidateOptions options;
  options.common_words_ratio = 0.0;
  return options;
}

TEST(CandidateFinder, TheBestOfAGroupStandsForIt) {
  CandidateFinder finder = GroupAndLoner(AnyNumberOfWords(), 100);
  const std::vector<LoopCandidate> alone = Add(finder, 50, Bag(0));
  // 1 is less than three quarters of 1.8.
  ASSERT_THAT(FramesOf(alone), ElementsAre(FrameId{1}));
  EXPECT_NEAR(alone[0].score, 0.6, 1e-5);
  EXPECT_NEAR(alone[0].group_score, 1.8, 1e-5);
}

TEST(CandidateFinder, TheBestGroupComesFirst) {
  CandidateOptions options = AnyNumberOfWords();
  options.group_score_ratio = 0.5;
  CandidateFinder finder = GroupAndLoner(options, 100);
  const std::vector<LoopCandidate> both = Add(finder, 50, Bag(0));
  ASSERT_THAT(FramesOf(both), ElementsAre(FrameId{1}, FrameId{4}));
  EXPECT_NEAR(both[1].score, 1.0, 1e-5);
  EXPECT_NEAR(both[1].group_score, 1.0, 1e-5);
}

TEST(CandidateFinder, AGroupHasAsManyNeighboursAsAskedFor) {
  const auto find = [](int group_size) {
    CandidateOptions options = AnyNumberOfWords();
    options.group_size = group_size;
    CandidateFinder finder = GroupAndLoner(options, 20);
    return Add(finder, 50, Bag(0));
  };
  // Nobody stands for another: 0.4 is less than three quarters of 0.6.
  EXPECT_THAT(FramesOf(find(0)), ElementsAre(FrameId{1}, FrameId{2}));
  // With the first neighbour only, place 2 brings the most: 0.5 + 0.6.
  const std::vector<LoopCandidate> pairs = find(1);
  ASSERT_THAT(FramesOf(pairs), ElementsAre(FrameId{1}));
  EXPECT_NEAR(pairs[0].group_score, 1.1, 1e-5);
}

class ConsistencyTest : public testing::Test {
 protected:
  // Places 0 to 3 in a row, each the neighbour of the one before, and place 4 elsewhere.
  ConsistencyTest() : finder_(kNumWords, {}) {
    Add(finder_, 0, Bag(0));
    for (int k = 1; k < 4; ++k) Add(finder_, k, Bag(100 * k), {k - 1});
    Add(finder_, 4, Bag(400));
  }

  // How consistent the next place is, that looks like an old one; 0 when that is not found.
  int SeeAgain(int old_place) {
    const std::vector<LoopCandidate> candidates = Add(finder_, next_++, Bag(100 * old_place));
    if (candidates.empty()) return 0;
    EXPECT_THAT(FramesOf(candidates), ElementsAre(FrameId{old_place}));
    return candidates.front().num_consistent;
  }

  CandidateFinder finder_;
  int next_ = 50;
};

TEST_F(ConsistencyTest, CountsPlacesInARow) {
  EXPECT_EQ(SeeAgain(0), 1);
  EXPECT_EQ(SeeAgain(1), 2);
  EXPECT_EQ(SeeAgain(1), 3);
  EXPECT_EQ(SeeAgain(3), 4);
}

TEST_F(ConsistencyTest, StartsAgainElsewhere) {
  EXPECT_EQ(SeeAgain(0), 1);
  EXPECT_EQ(SeeAgain(1), 2);
  EXPECT_EQ(SeeAgain(4), 1);
  EXPECT_EQ(SeeAgain(1), 1);
}

TEST_F(ConsistencyTest, StartsAgainAfterAPlaceThatIsNew) {
  EXPECT_EQ(SeeAgain(0), 1);
  EXPECT_EQ(SeeAgain(1), 2);
  EXPECT_EQ(SeeAgain(9), 0);
  EXPECT_EQ(SeeAgain(1), 1);
}

TEST_F(ConsistencyTest, JoinedPlacesAreOneGroup) {
  finder_.Join(FrameId{4}, FrameId{0});
  EXPECT_EQ(SeeAgain(0), 1);
  EXPECT_EQ(SeeAgain(4), 2);
}

TEST(CandidateFinder, JoinsBothWaysAndOnce) {
  CandidateFinder finder(kNumWords, {});
  Add(finder, 0, Bag(0));
  Add(finder, 1, Bag(100), {0});
  Add(finder, 2, Bag(200), {1, 0});
  Add(finder, 50, Bag(300));
  EXPECT_THAT(finder.NeighboursOf(FrameId{0}), ElementsAre(FrameId{1}, FrameId{2}));
  EXPECT_THAT(finder.NeighboursOf(FrameId{2}), ElementsAre(FrameId{1}, FrameId{0}));
  EXPECT_THAT(finder.NeighboursOf(FrameId{50}), IsEmpty());
  EXPECT_THAT(finder.NeighboursOf(FrameId{77}), IsEmpty());
  for (int k = 0; k < 3; ++k) {
    if (k == 1) {
      finder.Join(FrameId{50}, FrameId{0});
    } else {
      finder.Join(FrameId{0}, FrameId{50});
    }
    EXPECT_EQ(finder.NeighboursOf(FrameId{0}), Frames({1, 2, 50})) << k;
    EXPECT_EQ(finder.NeighboursOf(FrameId{50}), Frames({0})) << k;
  }
}

TEST(CandidateFinder, JoinedPlacesAddTheirScores) {
  CandidateFinder finder(kNumWords, AnyNumberOfWords());
  Add(finder, 0, LikeBagZero(60));
  Add(finder, 1, LikeBagZero(50));
  finder.Join(FrameId{0}, FrameId{1});
  const std::vector<LoopCandidate> candidates = Add(finder, 50, Bag(0));
  ASSERT_THAT(FramesOf(candidates), ElementsAre(FrameId{0}));
  EXPECT_NEAR(candidates[0].group_score, 1.1, 1e-5);
}

TEST(CandidateOptions, NamesTheFirstFieldOutOfRange) {
  EXPECT_FALSE(CandidateOptions{}.Problem());
  const auto problem = [](auto change) {
    CandidateOptions options;
    change(options);
    return options.Problem().value_or("none");
  };
  using Options = CandidateOptions&;
  EXPECT_TRUE(problem([](Options o) { o.recent_frames = -1; }).starts_with("recent_frames is -1"));
  for (const double ratio : {-0.5, 1.0, std::nan("")}) {
    EXPECT_TRUE(problem([&](Options o) {
                  o.common_words_ratio = ratio;
                }).starts_with("common_words_ratio is "));
    EXPECT_TRUE(problem([&](Options o) {
                  o.group_score_ratio = ratio;
                }).starts_with("group_score_ratio is "));
  }
  EXPECT_TRUE(problem([](Options o) { o.group_size = -2; }).starts_with("group_size is -2"));
}

TEST(CandidateOptions, OutOfRangeIsRefusedByName) {
  CandidateOptions options;
  options.group_size = -1;
  try {
    const CandidateFinder finder(kNumWords, options);
    ADD_FAILURE() << "expected a std::invalid_argument";
  } catch (const std::invalid_argument& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("group_size is -1"));
  }
}

}  // namespace
}  // namespace rotslam
