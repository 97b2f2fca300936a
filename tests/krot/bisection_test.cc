#include "krot/bisection.h"

#include <gtest/gtest.h>

#include "tests/krot/problem_from_scene.h"

namespace rotslam {
namespace {

TEST(MinimiseMaxResidual, ReachesZeroOnACleanScene) {
  SceneOptions options;
  options.num_views = 6;
  options.num_points = 40;
  const MinimaxProblem problem = ProblemFromScene(MakeScene(options));
  const BisectionResult result = MinimiseMaxResidual(problem, {});
  EXPECT_EQ(result.status, BisectionStatus::kConverged);
  EXPECT_LT(result.gamma_high, 1e-6);
}

TEST(MinimiseMaxResidual, BracketsNarrowlyUnderNoise) {
  for (const double noise_px : {0.1, 0.5, 2.0}) {
    SceneOptions options;
    options.num_views = 8;
    options.num_points = 60;
    options.noise_px = noise_px;
    const MinimaxProblem problem = ProblemFromScene(MakeScene(options));
    const BisectionResult result = MinimiseMaxResidual(problem, {});
    EXPECT_EQ(result.status, BisectionStatus::kConverged) << noise_px;
    EXPECT_GT(result.gamma_low, 0.99 * result.gamma_high - 1e-12) << noise_px;
    EXPECT_DOUBLE_EQ(result.gamma_high, MaxBoxResidual(problem, result.structure));
    EXPECT_GT(result.gamma_high * 700.0, noise_px);
    EXPECT_LT(result.gamma_high * 700.0, 5.0 * noise_px);
  }
}

}  // namespace
}  // namespace rotslam
