#include "apps/slam/map/cloud_outliers.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/scenes/scene.h"

namespace rotslam {
namespace {

// A wall of 2,000 points, 10 by 10, and ten points far from it and from each other.
PointMap WallAndStrays() {
  PointMap points;
  SceneRandom random(1);
  for (int k = 0; k < 2000; ++k) {
    points[TrackId{k}] = {random.Uniform(-5.0, 5.0), random.Uniform(-5.0, 5.0), 20.0};
  }
  for (int k = 0; k < 10; ++k) points[TrackId{5000 + k}] = {0.0, 30.0 * k, 60.0 + 10.0 * k};
  return points;
}

TEST(CloudOutliers, LeaveAndTheSurfaceStays) {
  const PointMap points = WallAndStrays();
  const PointMap rest = WithoutOutliers(points, {});
  EXPECT_GE(rest.size(), 1990u);
  for (const auto& [track, point] : rest) {
    EXPECT_LT(track.value, 2000);
    EXPECT_EQ(point, points.at(track));
  }
}

TEST(CloudOutliers, StayWhenAskedToOrWhenThereAreFewPoints) {
  CloudOutlierOptions options;
  options.remove = false;
  EXPECT_EQ(WithoutOutliers(WallAndStrays(), options).size(), 2010u);
  PointMap few;
  for (int k = 0; k < 16; ++k) few[TrackId{k}] = Eigen::Vector3d(k * k * k, 0.0, 0.0);
  EXPECT_EQ(WithoutOutliers(few, {}).size(), 16u);
  EXPECT_TRUE(WithoutOutliers({}, {}).empty());
}

TEST(CloudOutliers, RefuseOptionsOutOfRange) {
  CloudOutlierOptions options;
  options.max_sigmas = 0.0;
  EXPECT_THROW(WithoutOutliers({}, options), std::invalid_argument);
  EXPECT_EQ(options.Problem(), "max_sigmas is 0, must be above zero");
}

}  // namespace
}  // namespace rotslam
