#include "apps/slam/map/path_growth.h"

#include <cmath>

#include <gtest/gtest.h>

namespace rotslam {
namespace {

// A circle, 10 frames a second.
struct Circle {
  CenterMap centers;
  std::vector<double> timestamps_s;

  Circle() {
    for (int n = 0; n < 200; ++n) {
      timestamps_s.push_back(0.1 * n);
      centers[FrameId{n}] = {std::cos(0.05 * n), std::sin(0.05 * n), 0.0};
    }
  }
};

TEST(PathGrowth, IsTheErrorOfInterpolation) {
  const Circle circle;
  const PathGrowth growth(circle.centers, circle.timestamps_s);
  // The chord's sagitta over 2 x 4 frames, in the plane: two of three axes.
  const double sagitta = 1.0 - std::cos(0.05 * 4);
  EXPECT_NEAR(growth.OfInterpolation(0.4, 0.4), sagitta / std::sqrt(3.0), 1e-6);
  EXPECT_GT(growth.OfInterpolation(0.8, 0.8), 3.5 * growth.OfInterpolation(0.4, 0.4));
  EXPECT_NEAR(growth.OfInterpolation(0.2, 0.8), growth.OfInterpolation(0.4, 0.4), 1e-9);
}

TEST(PathGrowth, IsTheWayOfHolding) {
  const Circle circle;
  const PathGrowth growth(circle.centers, circle.timestamps_s);
  EXPECT_NEAR(growth.OfHolding(0.1), 0.05 / std::sqrt(3.0), 1e-4);
  EXPECT_GT(growth.OfHolding(0.8), 7.0 * growth.OfHolding(0.1));
}

TEST(PathGrowth, DoesNotTellFromFewFrames) {
  const PathGrowth growth({{FrameId{0}, {0, 0, 0}}, {FrameId{1}, {1, 0, 0}}}, {0.0, 0.1});
  EXPECT_EQ(growth.OfHolding(0.1), 0.0);
  EXPECT_EQ(growth.OfInterpolation(0.1, 0.1), 0.0);
}

}  // namespace
}  // namespace rotslam
