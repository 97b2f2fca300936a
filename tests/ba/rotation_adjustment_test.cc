#include "ba/rotation_adjustment.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "tests/ba/ba_scene.h"

namespace rotslam {
namespace {

constexpr double kFocalError = 1.04;

BaScene RotatingScene() {
  return MakeBaScene({.num_frames = 40,
                      .num_points = 1000,
                      .noise_px = 0.5,
                      .outlier_ratio = 0.05,
                      .still_first = 0,
                      .still_last = 39});
}

Camera WithFocal(Camera camera, double factor) {
  camera.fx *= factor;
  camera.fy *= factor;
  return camera;
}

double LargestErrorDeg(const RotationMap& found, const RotationMap& truth) {
  double largest = 0.0;
  for (const auto& [frame, cam_from_world] : found) {
    const Rotation error = cam_from_world * truth.at(frame).Inverse();
    largest = std::max(largest, error.Log().norm() / kRadFromDeg);
  }
  return largest;
}

TEST(RefinePureRotation, FindsTheFocalLengthThatACalibrationHasWrong) {
  const BaScene scene = RotatingScene();
  const BundleProblem start = PerturbedProblem(scene, 0.3, 0.0);
  const PureRotationResult result = RefinePureRotation(
      WithFocal(scene.camera, kFocalError), start.start.cam_from_world, start.start.tracks, {});
  ASSERT_TRUE(result.Usable());
  EXPECT_TRUE(result.lens_refined);
  EXPECT_NEAR(result.camera.fx / scene.camera.fx, 1.0, 2e-3);
  EXPECT_LT(LargestErrorDeg(result.cam_from_world, scene.truth.cam_from_world), 0.1);
  EXPECT_GT(result.num_observations, 0.94 * NumObservations(start.start.tracks));
  EXPECT_LT(result.num_observations, 0.97 * NumObservations(start.start.tracks));
}

TEST(RefinePureRotation, KeepsALensThatMayNotMove) {
  const BaScene scene = RotatingScene();
  const BundleProblem start = PerturbedProblem(scene, 0.3, 0.0);
  BundleOptions options;
  options.lens.refine_distortion = false;
  const Camera wrong = WithFocal(scene.camera, kFocalError);
  const PureRotationResult result =
      RefinePureRotation(wrong, start.start.cam_from_world, start.start.tracks, options);
  ASSERT_TRUE(result.Usable());
  EXPECT_FALSE(result.lens_refined);
  EXPECT_EQ(result.camera, wrong);
}

TEST(RefinePureRotation, ExplainsLittleOfWhatAMovingCameraSees) {
  const BaScene scene = MakeBaScene({.num_frames = 40, .num_points = 1000, .noise_px = 0.5});
  const PureRotationResult result =
      RefinePureRotation(scene.camera, scene.truth.cam_from_world, scene.truth.tracks, {});
  EXPECT_LT(result.num_observations, 0.2 * NumObservations(scene.truth.tracks));
}

TEST(RefinePureRotation, SaysSoWhenThereIsTooLittle) {
  EXPECT_EQ(RefinePureRotation(BaCamera(), {}, {}, {}).status, BundleStatus::kTooLittleData);
  const BaScene scene = RotatingScene();
  EXPECT_EQ(RefinePureRotation(BaCamera(), scene.truth.cam_from_world, {}, {}).status,
            BundleStatus::kTooLittleData);
}

}  // namespace
}  // namespace rotslam
