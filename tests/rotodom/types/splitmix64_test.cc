#include "rotodom/types/splitmix64.h"

#include <gtest/gtest.h>

namespace rotslam {
namespace {

TEST(SplitMix64, GivesTheNumbersOfTheReferenceImplementation) {
  // Of splitmix64.c by Sebastiano Vigna, seed 1234567.
  SplitMix64 random(1234567);
  EXPECT_EQ(random.Next(), 6457827717110365317ull);
  EXPECT_EQ(random.Next(), 3203168211198807973ull);
  EXPECT_EQ(random.Next(), 9817491932198370423ull);
  EXPECT_EQ(HashOf(1234567), 6457827717110365317ull);
}

TEST(SplitMix64, StaysBelowTheLimit) {
  SplitMix64 random(1);
  for (int k = 0; k < 1000; ++k) {
    const int index = random.Index(7);
    EXPECT_GE(index, 0);
    EXPECT_LT(index, 7);
  }
}

}  // namespace
}  // namespace rotslam
