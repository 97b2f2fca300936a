#include "krot/initialisation/epipolar_filter.h"

#include <numbers>

#include <gtest/gtest.h>

#include "tests/scenes/scene.h"

namespace rotslam {
namespace {

// What lies near its epipolar line passes, and of a track seen twice nobody is named: the L1 start
// and the classification find the rest (SolveKnownRotation.TenPercentOutliers...).
TEST(TestEpipolarPlanes, CatchesUniformOutliersAndSparesInliers) {
  for (const double ratio : {0.01, 0.05, 0.1}) {
    SceneOptions options;
    options.path = ScenePath::kStreet;
    options.num_views = 20;
    options.num_points = 2000;
    options.noise_px = 0.7;
    options.rotation_noise_deg = 0.03;
    options.outlier_ratio = ratio;
    const Scene scene = MakeScene(options);
    int caught = 0;
    int lost = 0;
    int observations = 0;
    for (const Track& track : scene.tracks) {
      observations += static_cast<int>(track.observations.size());
    }
    for (const ObservationIndex& index :
         TestEpipolarPlanes(scene.cam_from_world, scene.tracks, {}).outliers) {
      const Track& track = scene.tracks[index.track];
      const bool outlier =
          scene.outliers.contains({track.id, track.observations[index.observation].frame});
      (outlier ? caught : lost) += 1;
    }
    EXPECT_GT(caught, 0.85 * static_cast<double>(scene.outliers.size())) << ratio;
    EXPECT_LT(lost, 0.02 * observations) << ratio;
  }
}

TEST(TestEpipolarPlanes, SaysNothingAgainstPureRotation) {
  SceneOptions options;
  options.path = ScenePath::kPivot;
  options.noise_px = 0.5;
  const Scene scene = MakeScene(options);
  EXPECT_TRUE(TestEpipolarPlanes(scene.cam_from_world, scene.tracks, {}).outliers.empty());
}

// Two rays err, each by noise_px per axis.
TEST(TestEpipolarPlanes, MeasuresTheNoiseOfEachView) {
  for (const ScenePath path : {ScenePath::kStreet, ScenePath::kPivot}) {
    for (const double noise_px : {0.1, 0.7}) {
      SceneOptions options;
      options.path = path;
      options.num_views = 12;
      options.num_points = 1000;
      options.noise_px = noise_px;
      options.outlier_ratio = 0.05;
      const Scene scene = MakeScene(options);
      const auto noise_rad = TestEpipolarPlanes(scene.cam_from_world, scene.tracks, {}).noise_rad;
      EXPECT_EQ(noise_rad.size(), scene.cam_from_world.size());
      const double expected_px = std::numbers::sqrt2 * noise_px;
      for (const auto& [view, noise] : noise_rad) {
        // The plane's direction is drawn from two tracks; rays off the axis err by less.
        EXPECT_GT(700.0 * noise, 0.6 * expected_px) << view.value;
        EXPECT_LT(700.0 * noise, 1.6 * expected_px) << view.value;
      }
    }
  }
}

}  // namespace
}  // namespace rotslam
