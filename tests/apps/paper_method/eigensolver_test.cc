#include "apps/paper_method/eigensolver.h"

#include <algorithm>
#include <vector>

#include <gtest/gtest.h>

#include "rotodom/types/parallel.h"
#include "tests/rotodom/relative_rotation/pair_scene.h"

namespace rotslam {
namespace {

double ErrorDeg(const EigensolverEstimate& estimate, const PairScene& scene) {
  return (estimate.j_from_i * scene.j_from_i.Inverse()).AngleDeg();
}

double MedianErrorDeg(const PairSceneOptions& options, const Rotation& start_from_truth) {
  std::vector<double> errors_deg;
  for (int k = 0; k < 9; ++k) {
    PairSceneOptions scene_options = options;
    scene_options.seed = std::uint64_t(300 + k);
    const PairScene scene = MakePairScene(scene_options);
    const auto estimate = EstimateByEigensolver(scene.pairs, start_from_truth * scene.j_from_i, 1);
    errors_deg.push_back(estimate ? ErrorDeg(*estimate, scene) : 180.0);
  }
  std::sort(errors_deg.begin(), errors_deg.end());
  return errors_deg[errors_deg.size() / 2];
}

// With a wide baseline, and without one: the reason for which the paper chose it. Bounds are about
// twice what was measured (0.02 deg, and 0.17 and 0.10 without a baseline, where triangulation says
// nothing of inliers).
TEST(EstimateByEigensolver, RecoversTheRotationFromMatchesWithOutliers) {
  const Rotation start = Rotation::Exp({0.002, -0.003, 0.002});
  for (const double outlier_ratio : {0.0, 0.25}) {
    PairSceneOptions options{.num_pairs = 500, .noise_px = 0.3, .outlier_ratio = outlier_ratio};
    options.baseline_over_depth = 0.1;
    EXPECT_LT(MedianErrorDeg(options, start), 0.06) << outlier_ratio;
    options.baseline_over_depth = 0.0;
    EXPECT_LT(MedianErrorDeg(options, start), 0.35) << outlier_ratio;
  }
}

TEST(EstimateByEigensolver, CountsInliersOnly) {
  const PairScene scene = MakePairScene(
      {.num_pairs = 400, .baseline_over_depth = 0.1, .noise_px = 0.1, .outlier_ratio = 0.25});
  const auto estimate = EstimateByEigensolver(scene.pairs, scene.j_from_i, 1);
  ASSERT_TRUE(estimate);
  EXPECT_GT(estimate->inliers.size(), 250U);
  EXPECT_LT(estimate->inliers.size(), 330U);
  EXPECT_TRUE(std::is_sorted(estimate->inliers.begin(), estimate->inliers.end()));
  EXPECT_NEAR(estimate->translation_direction.norm(), 1.0, 1e-9);
}

TEST(EstimateByEigensolver, GivesTheSameForTheSameSeedOnAnyThread) {
  const PairScene scene = MakePairScene(
      {.num_pairs = 300, .baseline_over_depth = 0.1, .noise_px = 0.5, .outlier_ratio = 0.3});
  constexpr int kCount = 4;
  std::vector<Eigen::Vector4d> coefficients(kCount);
  ParallelFor(kCount, 4, [&](int k) {
    coefficients[k] = EstimateByEigensolver(scene.pairs, Rotation(), std::uint64_t(7 + k % 2))
                          ->j_from_i.Quaternion()
                          .coeffs();
  });
  for (int k = 2; k < kCount; ++k) EXPECT_EQ(coefficients[k], coefficients[k - 2]);
  EXPECT_NE(coefficients[0], coefficients[1]);
}

TEST(EstimateByEigensolver, NeedsMoreMatchesThanASample) {
  const PairScene scene = MakePairScene({.num_pairs = 10});
  EXPECT_FALSE(EstimateByEigensolver({}, Rotation(), 1));
  EXPECT_FALSE(EstimateByEigensolver(scene.pairs, Rotation(), 1));
}

}  // namespace
}  // namespace rotslam
