#include "krot/structure/blocks.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

namespace rotslam {
namespace {

// A path once around a circle, and points beside it.
Eigen::Vector3d CenterOf(int view) {
  const double angle = 2.0 * M_PI * view / 100.0;
  return {50.0 * std::cos(angle), 0.3 * std::sin(3.0 * angle), 50.0 * std::sin(angle)};
}

struct Gauge {
  double scale;
  Eigen::Vector3d shift;
};

class JoinBlocksTest : public testing::Test {
 protected:
  // Views first to last of the circle, and five points beside each, as a block of another gauge.
  // @param num_names  views have these many names; with 100 they meet again after one turn.
  Block MakeBlock(int first, int last, const Gauge& gauge, double noise, int num_names = 100) {
    const auto seen = [&](const Eigen::Vector3d& place) -> Eigen::Vector3d {
      const Eigen::Vector3d error(normal_(random_), normal_(random_), normal_(random_));
      return gauge.scale * (place + noise * error - gauge.shift);
    };
    Block block;
    for (int k = first; k <= last; ++k) {
      const int view = k % num_names;
      block.centers[FrameId{view}] = seen(CenterOf(view));
      for (int p = 0; p < 5; ++p) {
        const Eigen::Vector3d beside(
            4.0 * std::sin(view + p), 2.0 + p, 4.0 * std::cos(7 * view + p));
        block.points[TrackId{5 * view + p}] = seen(CenterOf(view) + beside);
      }
    }
    return block;
  }

  // Largest distance from the truth after the best scale and shift, by three views' word.
  static double ErrorOf(const CenterMap& centers) {
    const Eigen::Vector3d a = centers.begin()->second;
    const Eigen::Vector3d b = centers.rbegin()->second;
    const Eigen::Vector3d true_a = CenterOf(centers.begin()->first.value);
    const Eigen::Vector3d true_b = CenterOf(centers.rbegin()->first.value);
    const double scale = (true_b - true_a).norm() / (b - a).norm();
    double largest = 0.0;
    for (const auto& [view, center] : centers) {
      const Eigen::Vector3d error = scale * (center - a) + true_a - CenterOf(view.value);
      largest = std::max(largest, error.norm());
    }
    return largest;
  }

  std::mt19937 random_{3};
  std::normal_distribution<double> normal_;
};

const Gauge kGauges[] = {{1.0, {0.0, 0.0, 0.0}},
                         {0.2, {10.0, 0.0, 3.0}},
                         {7.0, {-3.0, 5.0, 1.0}},
                         {1.5, {0.0, 9.0, 0.0}}};

TEST_F(JoinBlocksTest, ARowComesOutInOneGauge) {
  const std::vector<Block> blocks = {MakeBlock(0, 29, kGauges[0], 0.0),
                                     MakeBlock(20, 49, kGauges[1], 0.0),
                                     MakeBlock(40, 69, kGauges[2], 0.0)};
  const auto places = JoinBlocks(blocks);
  for (const auto& place : places) ASSERT_TRUE(place);
  EXPECT_NEAR(places[1]->scale / places[0]->scale, 1.0 / 0.2, 1e-9);
  EXPECT_NEAR(places[2]->scale / places[0]->scale, 1.0 / 7.0, 1e-9);
  const CenterMap centers = BlendBlocks(blocks, places);
  EXPECT_EQ(centers.size(), 70u);
  EXPECT_LT(ErrorOf(centers), 1e-8);
}

// Every block has its first ten views 3 % too far apart, so that a row of them drifts in scale.
TEST_F(JoinBlocksTest, APlaceSeenAgainTakesDriftAway) {
  const auto last_by_first = [&](int num_names) {
    std::vector<Block> blocks;
    for (int k = 0; k <= 5; ++k) {
      Block& block =
          blocks.emplace_back(MakeBlock(20 * k, 20 * k + 29, kGauges[k % 4], 0.0, num_names));
      block.points.clear();
      if (k == 0) continue;
      const Eigen::Vector3d middle = block.centers.at(FrameId{20 * k % num_names});
      for (int view = 20 * k; view < 20 * k + 10; ++view) {
        Eigen::Vector3d& center = block.centers.at(FrameId{view % num_names});
        center = middle + 1.03 * (center - middle);
      }
    }
    const auto places = JoinBlocks(blocks);
    return (places[5]->scale * kGauges[1].scale) / (places[0]->scale * kGauges[0].scale);
  };
  EXPECT_GT(std::abs(last_by_first(/*num_names=*/1000) - 1.0), 0.1);
  EXPECT_LT(std::abs(last_by_first(/*num_names=*/100) - 1.0), 0.05);
}

TEST_F(JoinBlocksTest, NoiseAndWrongPointsAreOutvoted) {
  std::vector<Block> blocks = {MakeBlock(0, 29, kGauges[0], 0.02),
                               MakeBlock(20, 49, kGauges[1], 0.02),
                               MakeBlock(40, 69, kGauges[2], 0.02)};
  // A fifth of what the last two share is somebody else's.
  int k = 0;
  for (auto& [track, point] : blocks[1].points) {
    if (++k % 5 == 0) point += Eigen::Vector3d(normal_(random_), 20.0, normal_(random_));
  }
  const CenterMap centers = BlendBlocks(blocks, JoinBlocks(blocks));
  EXPECT_LT(ErrorOf(centers), 2.0);
}

TEST_F(JoinBlocksTest, WhatNothingTiesHasNoPlace) {
  std::vector<Block> blocks = {MakeBlock(0, 29, kGauges[0], 0.0),
                               MakeBlock(60, 69, kGauges[1], 0.0),
                               MakeBlock(20, 49, kGauges[2], 0.0)};
  const auto places = JoinBlocks(blocks);
  EXPECT_TRUE(places[0]);
  EXPECT_FALSE(places[1]);
  EXPECT_TRUE(places[2]);
  EXPECT_EQ(BlendBlocks(blocks, places).size(), 50u);
  EXPECT_TRUE(JoinBlocks({}).empty());
}

}  // namespace
}  // namespace rotslam
