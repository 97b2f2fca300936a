#include "apps/slam/map_correction/absolute_pose.h"

#include <gtest/gtest.h>

#include "rotodom/types/similarity.h"
#include "tests/ba/seen_points.h"

namespace rotslam {
namespace {

// In a world turned around, so that nothing near the origin sees the points.
PointsInView MakeTurnedView(CameraModel model,
                            int num_points,
                            double noise_px,
                            double outlier_ratio) {
  const Similarity turn = {1.0, Rotation::Exp({0.3, 2.6, 0.4}), {30.0, 5.0, -20.0}};
  PointsInView view = MakeView(model, num_points, noise_px, outlier_ratio);
  view.cam_from_world = turn.Move(view.cam_from_world);
  view.center_in_world = turn.Move(view.center_in_world);
  for (PointObservation2D3D& observation : view.observations) {
    observation.point_in_world = turn.Move(observation.point_in_world);
  }
  return view;
}

class AbsolutePoseForEveryCamera : public ::testing::TestWithParam<CameraModel> {};
INSTANTIATE_TEST_SUITE_P(Models,
                         AbsolutePoseForEveryCamera,
                         ::testing::ValuesIn(AllCameraModels()));

TEST_P(AbsolutePoseForEveryCamera, CleanSightingsGiveTheTruth) {
  const PointsInView view = MakeTurnedView(GetParam(), 100, 0.0, 0.0);
  const auto pose = FindAbsolutePose(view.camera, view.observations, {}, 1);
  ASSERT_TRUE(pose);
  EXPECT_LT(AngleErrorDeg(*pose, view), 1e-8);
  EXPECT_LT((pose->center_in_world - view.center_in_world).norm(), 1e-9 * 20.0);
  EXPECT_EQ(pose->num_inliers, 100);
}

TEST(FindAbsolutePose, EightOfTenMayBeWrong) {
  for (const std::uint64_t seed : {1, 2, 3}) {
    const PointsInView view = MakeTurnedView(CameraModel::kPinhole, 400, 0.5, 0.8);
    const auto pose = FindAbsolutePose(view.camera, view.observations, {}, seed);
    ASSERT_TRUE(pose);
    EXPECT_NEAR(pose->num_inliers, 80, 15);
    EXPECT_LT(AngleErrorDeg(*pose, view), 0.1);
    EXPECT_LT((pose->center_in_world - view.center_in_world).norm(), 0.02 * 20.0);
  }
}

TEST(FindAbsolutePose, FindsNoneInChance) {
  const PointsInView view = MakeTurnedView(CameraModel::kPinhole, 400, 0.5, 1.0);
  EXPECT_FALSE(FindAbsolutePose(view.camera, view.observations, {.min_inliers = 20}, 1));
  const PointsInView few = MakeTurnedView(CameraModel::kPinhole, 9, 0.5, 0.0);
  EXPECT_FALSE(FindAbsolutePose(few.camera, few.observations, {}, 1));
}

}  // namespace
}  // namespace rotslam
