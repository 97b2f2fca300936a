#include "rotodom/view_graph/consistency.h"

#include <vector>

#include <gtest/gtest.h>

#include "tests/scenes/scene.h"

namespace rotslam {
namespace {

Rotation Turned(double x_deg, double y_deg, double z_deg) {
  return Rotation::Exp(kRadFromDeg * Eigen::Vector3d(x_deg, y_deg, z_deg));
}

TEST(ChooseConsistent, TakesWhatSeveralPairsAgreeOn) {
  // Either pair's matches speak for a wrong motion, each for another one.
  const std::vector<PairHypotheses> pairs = {
      {{{Turned(12, 0, 3), 0.0}, {Turned(0.1, 0, 0), 0.2}}},
      {{{Turned(-9, 7, 0), 0.0}, {Turned(0, -0.2, 0), 0.1}}},
      {{{Turned(0, 0, 0.1), 0.0}}},
  };
  EXPECT_EQ(ChooseConsistent(pairs), (std::vector<int>{1, 1, 0}));
}

TEST(ChooseConsistent, DoesWithoutASureOne) {
  const std::vector<PairHypotheses> pairs = {
      {{{Turned(12, 0, 3), 0.0}, {Turned(0.1, 0, 0), 0.2}}},
      {{{Turned(-9, 7, 0), 0.0}, {Turned(0, -0.2, 0), 0.1}}},
  };
  EXPECT_EQ(ChooseConsistent(pairs), (std::vector<int>{1, 1}));
}

TEST(ChooseConsistent, FollowsTheMatchesWhereNoneAgree) {
  EXPECT_EQ(ChooseConsistent({}), std::vector<int>{});
  const PairHypotheses alone = {{{Turned(12, 0, 3), 0.0}, {Turned(0, 0, 0), 0.2}}};
  EXPECT_EQ(ChooseConsistent(std::vector{alone}), std::vector<int>{0});
  const PairHypotheses other = {{{Turned(-30, 0, 0), 0.0}, {Turned(0, 40, 0), 0.2}}};
  EXPECT_EQ(ChooseConsistent(std::vector{alone, other}), (std::vector<int>{0, 0}));
}

TEST(ChooseConsistent, HeavyPairsOutvoteLightOnes) {
  const PairHypotheses right = {{{Turned(0, 0, 0), 0.0}}, 30.0};
  const PairHypotheses wrong = {{{Turned(20, 0, 0), 0.0}}, 8.0};
  const PairHypotheses torn = {{{Turned(20, 0.1, 0), 0.0}, {Turned(0.1, 0, 0), 0.2}}, 10.0};
  EXPECT_EQ(ChooseConsistent(std::vector{wrong, torn, right}), (std::vector<int>{0, 1, 0}));
  EXPECT_EQ(ChooseConsistent(std::vector{wrong, torn, wrong, wrong}),
            (std::vector<int>{0, 0, 0, 0}));
}

// Wrong motions of different pairs agree by chance only; with one right hypothesis in two for each
// of four pairs, edges wrong by half a degree.
TEST(ChooseConsistent, IsRightForManyDraws) {
  SceneRandom random(5);
  const auto near = [&](double deg) {
    return Turned(random.Normal(deg), random.Normal(deg), random.Normal(deg));
  };
  int num_wrong = 0;
  for (int draw = 0; draw < 500; ++draw) {
    std::vector<PairHypotheses> pairs;
    std::vector<int> expected;
    for (int k = 0; k < 4; ++k) {
      const bool right_is_second = random.Uniform(0.0, 1.0) < 0.5;
      PairHypotheses pair = {{{near(15.0), 0.0}, {near(15.0), random.Uniform(0.0, 0.25)}}};
      pair.hypotheses[right_is_second].cam_from_world = near(0.3);
      pairs.push_back(pair);
      expected.push_back(right_is_second);
    }
    num_wrong += ChooseConsistent(pairs) != expected;
  }
  EXPECT_LE(num_wrong, 10);
  RecordProperty("num_wrong", num_wrong);
}

}  // namespace
}  // namespace rotslam
