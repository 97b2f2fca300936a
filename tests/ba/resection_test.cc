#include "ba/resection.h"

#include <cmath>

#include <gtest/gtest.h>

#include "tests/ba/seen_points.h"

namespace rotslam {
namespace {

ResectionStart NearStart(const PointsInView& view, double angle_deg, double offset) {
  ResectionStart start;
  start.cam_from_world =
      Rotation::Exp(angle_deg * kRadFromDeg * Eigen::Vector3d(0.6, -0.64, 0.48)) *
      view.cam_from_world;
  start.center_in_world = view.center_in_world + offset * Eigen::Vector3d(0.48, 0.6, -0.64);
  return start;
}

class ResectionForEveryCamera : public ::testing::TestWithParam<CameraModel> {};
INSTANTIATE_TEST_SUITE_P(Models, ResectionForEveryCamera, ::testing::ValuesIn(AllCameraModels()));

TEST_P(ResectionForEveryCamera, CleanSightingsGiveTheTruth) {
  const PointsInView view = MakeView(GetParam(), 100, 0.0, 0.0);
  const auto pose = ResectFrame(view.camera, view.observations, NearStart(view, 2.0, 0.8), {});
  ASSERT_TRUE(pose);
  EXPECT_LT(AngleErrorDeg(*pose, view), 1e-8);
  EXPECT_LT((pose->center_in_world - view.center_in_world).norm(), 1e-9 * 20.0);
  EXPECT_EQ(pose->num_inliers, 100);
}

// Squared error in units of the covariance: 6 on average, above 22.5 once in a thousand.
double SquaredMahalanobis(const ResectedPose& pose, const PointsInView& view) {
  Eigen::Matrix<double, 6, 1> error;
  error << (pose.cam_from_world * view.cam_from_world.Inverse()).Log(),
      pose.center_in_world - view.center_in_world;
  return error.dot(pose.covariance.inverse() * error);
}

TEST(ResectFrame, ThirtyPercentOutliersDoNoHarm) {
  for (const double offset : {0.1, 0.5, 2.0}) {
    const PointsInView view = MakeView(CameraModel::kPinhole, 500, 0.5, 0.3);
    const auto pose = ResectFrame(view.camera, view.observations, NearStart(view, 1.0, offset), {});
    ASSERT_TRUE(pose);
    EXPECT_NEAR(pose->num_inliers, 350, 30);
    EXPECT_LT(SquaredMahalanobis(*pose, view), 22.5);
  }
}

TEST(ResectFrame, CovarianceTellsTheErrorToExpect) {
  // Mean of the squared error in its own covariance's unit, over 100 draws of noise: 6 unknowns.
  PointsInView view = MakeView(CameraModel::kPinhole, 200, 0.0, 0.0);
  const std::vector<PointObservation2D3D> clean = view.observations;
  for (const double blur : {0.0, 3.0}) {
    std::mt19937 random(3);
    std::normal_distribution<double> normal(0.0, 0.5);
    double sum = 0.0;
    for (int draw = 0; draw < 100; ++draw) {
      view.observations = clean;
      for (std::size_t k = 0; k < clean.size(); ++k) {
        PointObservation2D3D& observation = view.observations[k];
        const double angle = 0.1 * static_cast<double>(k);
        const Eigen::Vector2d along = blur * Eigen::Vector2d(std::cos(angle), std::sin(angle));
        observation.keypoint_px += Eigen::Vector2d(normal(random), normal(random));
        observation.keypoint_px += normal(random) * along;
        observation.sigma_px = 0.5;
        observation.blur = along.cast<float>();
      }
      const auto pose = ResectFrame(view.camera,
                                    view.observations,
                                    NearStart(view, 0.5, 0.2),
                                    {.has_motion_blur = true, .loss_scale = 20.0});
      ASSERT_TRUE(pose);
      sum += SquaredMahalanobis(*pose, view);
    }
    EXPECT_NEAR(sum / 100.0, 6.0, 1.2) << blur;  // standard deviation of the mean is 0.35
  }
}

TEST(ResectFrame, HoldsWhatItIsToldTo) {
  const PointsInView view = MakeView(CameraModel::kPinhole, 100, 0.0, 0.0);
  ResectionStart start = NearStart(view, 0.0, 0.8);
  const auto centred =
      ResectFrame(view.camera, view.observations, start, {.refine_rotation = false});
  ASSERT_TRUE(centred);
  EXPECT_EQ(centred->cam_from_world.Quaternion().coeffs(),
            start.cam_from_world.Quaternion().coeffs());
  EXPECT_LT((centred->center_in_world - view.center_in_world).norm(), 1e-8);
  EXPECT_EQ((centred->covariance.topRows<3>().norm()), 0.0);
  start = NearStart(view, 1.0, 0.0);
  const auto turned = ResectFrame(view.camera, view.observations, start, {.refine_center = false});
  ASSERT_TRUE(turned);
  EXPECT_EQ(turned->center_in_world, start.center_in_world);
  EXPECT_LT(AngleErrorDeg(*turned, view), 1e-8);
}

TEST(ResectFrame, ATightRotationPriorHoldsTheRotation) {
  const PointsInView view = MakeView(CameraModel::kPinhole, 200, 0.5, 0.0);
  ResectionStart start = NearStart(view, 0.0, 0.3);
  const auto free = ResectFrame(view.camera, view.observations, start, {});
  start.rotation_covariance = 1e-14 * Eigen::Matrix3d::Identity();
  const auto tight = ResectFrame(view.camera, view.observations, start, {});
  start.rotation_covariance = 1e6 * Eigen::Matrix3d::Identity();
  const auto loose = ResectFrame(view.camera, view.observations, start, {});
  ASSERT_TRUE(free);
  ASSERT_TRUE(tight);
  ASSERT_TRUE(loose);
  EXPECT_LT(AngleErrorDeg(*tight, view), 1e-4);
  EXPECT_GT(AngleErrorDeg(*free, view), 1e-3);
  EXPECT_LT((loose->center_in_world - free->center_in_world).norm(), 1e-7);
  EXPECT_LT(tight->covariance(0, 0), free->covariance(0, 0));
}

// A hundred standard deviations off, as a plane's second motion can be that frames see alone.
TEST(ResectFrame, ARotationThatPointsRefuteCountsForNothing) {
  const ResectionOptions options = {.max_iterations = 200};
  const PointsInView view = MakeView(CameraModel::kPinhole, 200, 0.3, 0.0);
  ResectionStart start = NearStart(view, 0.2, 0.3);
  start.rotation_covariance = std::pow(0.002 * kRadFromDeg, 2) * Eigen::Matrix3d::Identity();
  const auto pose = ResectFrame(view.camera, view.observations, start, options);
  start.rotation_covariance.reset();
  const auto by_points = ResectFrame(view.camera, view.observations, start, options);
  ASSERT_TRUE(pose);
  ASSERT_TRUE(by_points);
  EXPECT_LT(SquaredMahalanobis(*pose, view), 22.5);
  EXPECT_EQ(pose->num_inliers, by_points->num_inliers);
  EXPECT_LT((pose->covariance - by_points->covariance).norm(), 1e-6 * by_points->covariance.norm());
}

TEST(ResectFrame, PointsThatFitARotationWithinTheirDeviationsDoNotRefuteIt) {
  PointsInView view = MakeView(CameraModel::kPinhole, 100, 0.05, 0.0);
  ResectionStart start = NearStart(view, 0.2, 0.3);
  start.rotation_covariance = std::pow(0.002 * kRadFromDeg, 2) * Eigen::Matrix3d::Identity();
  // Held, it leaves 0.78 px of each.
  const auto turn_deg = [&](double sigma_px) {
    for (PointObservation2D3D& observation : view.observations) observation.sigma_px = sigma_px;
    const auto pose = ResectFrame(view.camera, view.observations, start, {.max_iterations = 200});
    return pose ? AngleErrorDeg(*pose, view) : 180.0;
  };
  EXPECT_LT(turn_deg(0.3), 0.01);
  EXPECT_NEAR(turn_deg(1.0), 0.2, 0.01);
}

TEST(AssessPose, TellsAboutAPoseWhatResectionWould) {
  const PointsInView view = MakeView(CameraModel::kPinhole, 300, 0.5, 0.1);
  const auto found = ResectFrame(view.camera, view.observations, NearStart(view, 0.5, 0.2), {});
  ASSERT_TRUE(found);
  ResectionStart pose{found->cam_from_world, found->center_in_world, std::nullopt};
  const auto assessed = AssessPose(view.camera, view.observations, pose, {});
  ASSERT_TRUE(assessed);
  EXPECT_EQ(assessed->center_in_world, found->center_in_world);
  EXPECT_EQ(assessed->num_inliers, found->num_inliers);
  EXPECT_EQ(assessed->variance_factor, found->variance_factor);
  EXPECT_EQ(assessed->covariance, found->covariance);
  // A pose that is a little off stays, and its residuals tell.
  pose.center_in_world.x() += 0.05;
  const auto off = AssessPose(view.camera, view.observations, pose, {});
  ASSERT_TRUE(off);
  EXPECT_EQ(off->center_in_world, pose.center_in_world);
  EXPECT_GT(off->variance_factor, 1.5 * found->variance_factor);
  EXPECT_FALSE(AssessPose(view.camera, {}, pose, {}));
}

TEST(ResectFrame, SaysNoToTooLittle) {
  const PointsInView view = MakeView(CameraModel::kPinhole, 100, 0.0, 0.0);
  const ResectionStart start = NearStart(view, 0.5, 0.2);
  EXPECT_FALSE(ResectFrame(view.camera, {}, start, {}));
  const std::vector<PointObservation2D3D> few(view.observations.begin(),
                                              view.observations.begin() + 9);
  EXPECT_FALSE(ResectFrame(view.camera, few, start, {}));
  EXPECT_FALSE(ResectFrame(
      view.camera, std::vector<PointObservation2D3D>(50, view.observations[0]), start, {}));
  std::vector<PointObservation2D3D> nan = view.observations;
  for (PointObservation2D3D& observation : nan) observation.keypoint_px.x() = std::nan("");
  EXPECT_FALSE(ResectFrame(view.camera, nan, start, {}));
  std::vector<PointObservation2D3D> behind = view.observations;
  for (PointObservation2D3D& observation : behind) {
    observation.point_in_world = 2.0 * view.center_in_world - observation.point_in_world;
  }
  EXPECT_FALSE(ResectFrame(view.camera, behind, start, {}));
  ResectionStart broken = start;
  broken.center_in_world.x() = std::nan("");
  EXPECT_THROW(ResectFrame(view.camera, view.observations, broken, {}), std::invalid_argument);
  EXPECT_THROW(ResectFrame(view.camera, view.observations, start, {.min_inliers = 1}),
               std::invalid_argument);
}

}  // namespace
}  // namespace rotslam
