// Known rotation and bundle adjustment in one chain, as `run` and `solve` have it.

#include "apps/refinement.h"

#include <algorithm>
#include <cmath>
#include <string>

#include <gtest/gtest.h>

#include "tests/scenes/alignment.h"
#include "tests/scenes/scene.h"

namespace rotslam {
namespace {

SceneOptions Street(double outlier_ratio) {
  SceneOptions options;
  options.path = ScenePath::kStreet;
  options.num_views = 30;
  options.num_points = 2000;
  options.noise_px = 0.5;
  options.rotation_noise_deg = 0.03;
  options.outlier_ratio = outlier_ratio;
  return options;
}

BundleResult SolveChain(const Scene& scene, const std::string& start) {
  KrotOptions krot_options;
  krot_options.start = start;
  krot_options.use_bracket = start == "bisection";
  const KrotSolution krot =
      SolveKnownRotation(scene.cam_from_world, scene.tracks, scene.camera, krot_options);
  EXPECT_TRUE(krot.Usable()) << krot.message;
  RefinedComponents refined =
      RefineComponents(scene.cam_from_world, krot, scene.tracks, {}, scene.camera, {});
  EXPECT_EQ(refined.bundles.size(), 1U);
  EXPECT_TRUE(refined.bundles.front().Usable()) << refined.bundles.front().message;
  return std::move(refined.bundles.front());
}

double ErrorOf(const BundleResult& bundle, const Scene& scene) {
  const CenterMap& centers = bundle.reconstruction.center_in_world;
  return CompareCenters(
             centers, scene.true_center_in_world, AlignCenters(centers, scene.true_center_in_world))
      .rmse;
}

TEST(Chain, ThreeStartsEndInOneMinimum) {
  const Scene scene = MakeScene(Street(0.05));
  const BundleResult l1 = SolveChain(scene, "l1");
  for (const char* start : {"bisection", "linear"}) {
    const BundleResult other = SolveChain(scene, start);
    EXPECT_NEAR(static_cast<double>(other.summary.num_observations) / l1.summary.num_observations,
                1.0,
                1e-3)
        << start;
    EXPECT_NEAR(other.summary.final_cost / l1.summary.final_cost, 1.0, 1e-3) << start;
    EXPECT_NE(other.summary.initial_cost, l1.summary.initial_cost) << start;
  }
}

struct Kept {
  double outliers = 0.0;  // shares
  double inliers = 0.0;
};

Kept KeptOf(const BundleResult& bundle, const Scene& scene) {
  double outliers = 0.0;
  double inliers = 0.0;
  for (const Track& track : bundle.reconstruction.tracks) {
    for (const Observation& observation : track.observations) {
      const bool is_outlier = scene.outliers.contains({track.id, observation.frame});
      ++(is_outlier ? outliers : inliers);
    }
  }
  double num_inliers = -static_cast<double>(scene.outliers.size());
  for (const Track& track : scene.tracks) {
    num_inliers += static_cast<double>(track.observations.size());
  }
  return {outliers / static_cast<double>(scene.outliers.size()), inliers / num_inliers};
}

class ChainWithOutliers : public ::testing::TestWithParam<double> {};
INSTANTIATE_TEST_SUITE_P(Ratios, ChainWithOutliers, ::testing::Values(0.01, 0.05, 0.1));

TEST_P(ChainWithOutliers, RemovesThemAndKeepsTheRest) {
  // Over three draws of noise: errors of one differ by half from the next.
  double clean_error = 0.0;
  double dirty_error = 0.0;
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    SceneOptions options = Street(0.0);
    options.seed = seed;
    const Scene clean = MakeScene(options);
    options.outlier_ratio = GetParam();
    const Scene dirty = MakeScene(options);
    const BundleResult with = SolveChain(dirty, "l1");
    const Kept kept = KeptOf(with, dirty);
    EXPECT_LE(kept.outliers, 0.05) << seed;
    EXPECT_GE(kept.inliers, 0.98) << seed;
    clean_error += ErrorOf(SolveChain(clean, "l1"), clean);
    dirty_error += ErrorOf(with, dirty);
  }
  EXPECT_LE(dirty_error, 1.5 * clean_error);
}

}  // namespace
}  // namespace rotslam
