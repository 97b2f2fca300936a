#include "ba/absolute_pose.h"

#include <gtest/gtest.h>

#include "tests/ba/seen_points.h"

namespace rotslam {
namespace {

class AbsolutePoseForEveryCamera : public ::testing::TestWithParam<CameraModel> {};
INSTANTIATE_TEST_SUITE_P(Models,
                         AbsolutePoseForEveryCamera,
                         ::testing::Values(CameraModel::kPinhole,
                                           CameraModel::kRadtan,
                                           CameraModel::kEquidistant));

TEST_P(AbsolutePoseForEveryCamera, CleanSightingsGiveTheTruth) {
  const View view = MakeView(GetParam(), 100, 0.0, 0.0);
  const auto pose = FindAbsolutePose(view.camera, view.sightings, {}, 1);
  ASSERT_TRUE(pose);
  EXPECT_LT(AngleErrorDeg(*pose, view), 1e-8);
  EXPECT_LT((pose->center_in_world - view.center_in_world).norm(), 1e-9 * 20.0);
  EXPECT_EQ(pose->num_inliers, 100);
}

TEST(FindAbsolutePose, EightOfTenMayBeWrong) {
  for (const std::uint64_t seed : {1, 2, 3}) {
    const View view = MakeView(CameraModel::kPinhole, 400, 0.5, 0.8);
    const auto pose = FindAbsolutePose(view.camera, view.sightings, {}, seed);
    ASSERT_TRUE(pose);
    EXPECT_NEAR(pose->num_inliers, 80, 15);
    EXPECT_LT(AngleErrorDeg(*pose, view), 0.1);
    EXPECT_LT((pose->center_in_world - view.center_in_world).norm(), 0.02 * 20.0);
  }
}

TEST(FindAbsolutePose, FindsNoneInChance) {
  const View view = MakeView(CameraModel::kPinhole, 400, 0.5, 1.0);
  EXPECT_FALSE(FindAbsolutePose(view.camera, view.sightings, {.min_inliers = 20}, 1));
  const View few = MakeView(CameraModel::kPinhole, 9, 0.5, 0.0);
  EXPECT_FALSE(FindAbsolutePose(few.camera, few.sightings, {}, 1));
}

}  // namespace
}  // namespace rotslam
