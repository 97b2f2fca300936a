#include "krot/l1_interior.h"

#include <gtest/gtest.h>

#include "tests/krot/problem_from_scene.h"

namespace rotslam {
namespace {

TEST(SolveL1SlackInterior, AgreesWithTheLpEngine) {
  for (const ScenePath path : {ScenePath::kRandom, ScenePath::kStreet}) {
    for (const double gamma : {4.0 / 700.0, 1.0 / 700.0, 0.0}) {
      SceneOptions options;
      options.path = path;
      options.num_views = path == ScenePath::kStreet ? 20 : 8;
      options.num_points = path == ScenePath::kStreet ? 200 : 120;
      options.noise_px = 0.5;
      options.outlier_ratio = 0.05;
      const MinimaxProblem problem = ProblemFromScene(MakeScene(options));
      const MinimaxLpResult expected = SolveL1Slack(problem, gamma, 10.0);
      const MinimaxLpResult result = SolveL1SlackInterior(problem, gamma, 10.0);
      ASSERT_EQ(result.call, LpCallStatus::kCompleted);
      EXPECT_NEAR(result.objective, expected.objective, 1e-4 * expected.objective);
    }
  }
}

TEST(SolveL1SlackInterior, PricesOfObservationsCount) {
  SceneOptions scene;
  scene.noise_px = 0.5;
  scene.outlier_ratio = 0.1;
  const MinimaxProblem problem = ProblemFromScene(MakeScene(scene));
  std::vector<double> weights;
  for (std::size_t o = 0; o < problem.observations.size(); ++o) {
    weights.push_back(o % 3 == 0 ? 1e-3 : 1.0);
  }
  const MinimaxLpResult expected = SolveL1Slack(problem, 1.0 / 700.0, 5.0, weights);
  const MinimaxLpResult result = SolveL1SlackInterior(problem, 1.0 / 700.0, 5.0, weights);
  ASSERT_EQ(result.call, LpCallStatus::kCompleted);
  EXPECT_NEAR(result.objective, expected.objective, 1e-4 * expected.objective);
  // Multipliers between nothing and the price, as the dual program wants them.
  for (std::size_t o = 0; o < weights.size(); ++o) {
    for (int k = 0; k < 5; ++k) {
      EXPECT_GE(result.multipliers[5 * o + k], 0.0);
      EXPECT_LE(result.multipliers[5 * o + k], (k < 4 ? 1.0 : 5.0) * weights[o] * (1.0 + 1e-9));
    }
  }
}

TEST(SolveL1SlackInterior, RefusesWhatIsNoProgram) {
  const MinimaxProblem problem = ProblemFromScene(MakeScene({}));
  EXPECT_THROW(SolveL1SlackInterior(problem, -1.0, 1.0), std::invalid_argument);
  EXPECT_THROW(SolveL1SlackInterior(problem, 0.01, 1.0, {1.0, 2.0}), std::invalid_argument);
  EXPECT_THROW(SolveL1SlackInterior({}, 0.01, 1.0), std::invalid_argument);
}

}  // namespace
}  // namespace rotslam
