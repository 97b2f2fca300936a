#include "rotodom/types/disjoint_sets.h"

#include <random>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

namespace rotslam {
namespace {

TEST(DisjointSets, AreNamedByTheirSmallestNumber) {
  DisjointSets sets;
  EXPECT_EQ(sets.Find(7), 7);
  EXPECT_TRUE(sets.Join(9, 4));
  EXPECT_TRUE(sets.Join(2, 9));
  EXPECT_FALSE(sets.Join(2, 4));
  EXPECT_EQ(sets.Find(9), 2);
  EXPECT_EQ(sets.Find(3), 3);
  EXPECT_EQ(sets.Find(1000), 1000);
}

// Against sets that are painted anew at every join.
TEST(DisjointSets, HoldWhatWasJoined) {
  constexpr int kSize = 60;
  std::mt19937 random(1);
  std::vector<int> painted(kSize);
  for (int k = 0; k < kSize; ++k) painted[k] = k;
  DisjointSets roomy(kSize);
  DisjointSets growing;
  for (int join = 0; join < 50; ++join) {
    const int a = static_cast<int>(random() % kSize);
    const int b = static_cast<int>(random() % kSize);
    const auto [name, gone] = std::minmax({painted[a], painted[b]});
    EXPECT_EQ(roomy.Join(a, b), name != gone);
    EXPECT_EQ(growing.Join(a, b), name != gone);
    for (int& set : painted) set = set == gone ? name : set;
    const DisjointSets& same = roomy;
    for (int k = 0; k < kSize; ++k) {
      ASSERT_EQ(same.Find(k), painted[k]);
      ASSERT_EQ(growing.Find(k), painted[k]);
      ASSERT_EQ(roomy.Find(k), painted[k]);
    }
  }
}

}  // namespace
}  // namespace rotslam
