#include "rotodom/tracking/flow_field.h"

#include <gtest/gtest.h>

namespace rotslam {
namespace {

constexpr int kWidth = 600;
constexpr int kHeight = 400;

TEST(FlowField, IsZeroWhereNothingIsKnown) {
  const FlowField field(kWidth, kHeight);
  EXPECT_EQ(field.At({0.0, 0.0}), Eigen::Vector2d(0.0, 0.0));
  EXPECT_EQ(field.At({599.0, 399.0}), Eigen::Vector2d(0.0, 0.0));
}

TEST(FlowField, GivesTheMeanOfTheRegion) {
  FlowField field(kWidth, kHeight);
  field.Add({10.0, 10.0}, {1.0, -2.0});
  field.Add({12.0, 14.0}, {3.0, 4.0});
  field.Add({500.0, 300.0}, {-30.0, 70.0});
  EXPECT_EQ(field.At({11.0, 11.0}), Eigen::Vector2d(2.0, 1.0));
  EXPECT_EQ(field.At({501.0, 301.0}), Eigen::Vector2d(-30.0, 70.0));
}

TEST(FlowField, FallsBackToTheMeanOfAll) {
  FlowField field(kWidth, kHeight);
  field.Add({10.0, 10.0}, {1.0, -2.0});
  field.Add({12.0, 14.0}, {3.0, 4.0});
  field.Add({500.0, 300.0}, {5.0, 7.0});
  EXPECT_EQ(field.At({300.0, 200.0}), Eigen::Vector2d(3.0, 3.0));
}

TEST(FlowField, ForgetsTheOrder) {
  FlowField forward(kWidth, kHeight);
  FlowField backward(kWidth, kHeight);
  for (int k = 0; k < 50; ++k) {
    forward.Add({12.0 * k, 8.0 * k}, {k, -2 * k});
    const int n = 49 - k;
    backward.Add({12.0 * n, 8.0 * n}, {n, -2 * n});
  }
  for (int k = 0; k < 50; ++k) {
    const Eigen::Vector2d px(12.0 * k, 8.0 * (49 - k));
    EXPECT_EQ(forward.At(px), backward.At(px)) << k;
  }
}

// A predicted position may lie outside the image.
TEST(FlowField, TakesTheNearestRegionOutsideTheImage) {
  FlowField field(kWidth, kHeight);
  field.Add({599.9, 399.9}, {1.0, 1.0});
  field.Add({1.0, 1.0}, {9.0, 9.0});
  EXPECT_EQ(field.At({700.0, 5000.0}), Eigen::Vector2d(1.0, 1.0));
  EXPECT_EQ(field.At({-700.0, -5000.0}), Eigen::Vector2d(9.0, 9.0));
  field.Add({-3.0, -100.0}, {5.0, 5.0});
  EXPECT_EQ(field.At({1.0, 1.0}), Eigen::Vector2d(7.0, 7.0));
}

}  // namespace
}  // namespace rotslam
