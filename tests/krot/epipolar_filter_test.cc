#include "krot/epipolar_filter.h"

#include <gtest/gtest.h>

#include "tests/scenes/scene.h"

namespace rotslam {
namespace {

// What lies near its epipolar line passes, and of a track seen twice nobody is named: the L1 start
// and the classification find the rest (SolveKnownRotation.TenPercentOutliers...).
TEST(FindEpipolarOutliers, CatchesUniformOutliersAndSparesInliers) {
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
         FindEpipolarOutliers(scene.cam_from_world, scene.tracks, {})) {
      const Track& track = scene.tracks[index.track];
      const bool outlier =
          scene.outliers.contains({track.id, track.observations[index.observation].frame});
      (outlier ? caught : lost) += 1;
    }
    EXPECT_GT(caught, 0.85 * static_cast<double>(scene.outliers.size())) << ratio;
    EXPECT_LT(lost, 0.02 * observations) << ratio;
  }
}

TEST(FindEpipolarOutliers, SaysNothingAgainstPureRotation) {
  SceneOptions options;
  options.path = ScenePath::kPivot;
  options.noise_px = 0.5;
  const Scene scene = MakeScene(options);
  EXPECT_TRUE(FindEpipolarOutliers(scene.cam_from_world, scene.tracks, {}).empty());
}

}  // namespace
}  // namespace rotslam
