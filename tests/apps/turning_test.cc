#include "apps/turning.h"

#include <gtest/gtest.h>

#include "tests/ba/ba_scene.h"

namespace rotslam {
namespace {

// A camera that looks around in its place, or drives along a street.
BaScene MakeScene(bool turns) {
  return MakeBaScene({.num_frames = 24,
                      .num_points = 2200,
                      .noise_px = 0.5,
                      .outlier_ratio = 0.05,
                      .still_first = 0,
                      .still_last = turns ? 23 : -1});
}

Camera WithFocal(Camera camera, double factor) {
  camera.fx *= factor;
  camera.fy *= factor;
  return camera;
}

TEST(FindTurning, BelievesInATurnThatAnotherLensExplains) {
  const BaScene scene = MakeScene(true);
  const BundleProblem start = PerturbedProblem(scene, 0.3, 0.0);
  for (const double factor : {0.94, 1.06}) {
    const auto turning = FindTurning(
        WithFocal(scene.camera, factor), start.start.cam_from_world, start.start.tracks, 0, {});
    ASSERT_TRUE(turning.has_value()) << factor;
    EXPECT_NEAR(turning->camera.fx / scene.camera.fx, 1.0, 2e-3) << factor;
  }
}

TEST(FindTurning, LeavesAGoodCalibrationToTheTestOfPairs) {
  const BaScene scene = MakeScene(true);
  EXPECT_FALSE(
      FindTurning(scene.camera, scene.truth.cam_from_world, scene.truth.tracks, 0, {}).has_value());
}

TEST(FindTurning, NeverBelievesThatAStreetIsATurn) {
  const BaScene scene = MakeScene(false);
  for (const double factor : {1.0, 1.06}) {
    const Camera camera = WithFocal(scene.camera, factor);
    EXPECT_FALSE(
        FindTurning(camera, scene.truth.cam_from_world, scene.truth.tracks, 0, {}).has_value())
        << factor;
  }
}

TEST(FindTurning, GivesWayToPositionsThatExplainMore) {
  const BaScene scene = MakeScene(true);
  const Camera camera = WithFocal(scene.camera, 1.06);
  const auto turning = FindTurning(camera, scene.truth.cam_from_world, scene.truth.tracks, 0, {});
  ASSERT_TRUE(turning.has_value());
  EXPECT_FALSE(
      FindTurning(camera, scene.truth.cam_from_world, scene.truth.tracks, Redundancy(*turning), {})
          .has_value());
}

}  // namespace
}  // namespace rotslam
