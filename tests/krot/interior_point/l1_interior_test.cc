#include "krot/interior_point/l1_interior.h"

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
      const MinimaxLpResult expected = SolveL1Slack({problem, gamma, 10.0});
      const MinimaxLpResult result = SolveL1SlackInterior({problem, gamma, 10.0});
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
  const MinimaxLpResult expected = SolveL1Slack({problem, 1.0 / 700.0, 5.0, weights});
  const MinimaxLpResult result = SolveL1SlackInterior({problem, 1.0 / 700.0, 5.0, weights});
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

TEST(SolveL1SlackInterior, IsSoonerDoneFromTheAnswerAtOtherPrices) {
  SceneOptions scene;
  scene.path = ScenePath::kStreet;
  scene.num_views = 20;
  scene.num_points = 200;
  scene.noise_px = 0.5;
  scene.outlier_ratio = 0.05;
  const MinimaxProblem problem = ProblemFromScene(MakeScene(scene));
  const double gamma = 1.0 / 700.0;
  const MinimaxLpResult before = SolveL1SlackInterior({problem, gamma, 10.0});
  std::vector<double> weights;
  for (const ImageObservation& observation : problem.observations) {
    const double excess = BoxResidual(problem, before.structure, observation) / gamma;
    weights.push_back(excess > 1.01 ? 0.05 : 0.2);
  }
  const MinimaxLpResult expected = SolveL1SlackInterior({problem, gamma, 10.0, weights});
  L1InteriorOptions options;
  options.first_product = 1e-3;
  const MinimaxLpResult result =
      SolveL1SlackInterior({problem, gamma, 10.0, weights}, options, &before.structure);
  ASSERT_EQ(result.call, LpCallStatus::kCompleted);
  EXPECT_NEAR(result.objective, expected.objective, 1e-4 * expected.objective);
  EXPECT_LT(result.iterations, expected.iterations);
}

TEST(SolveL1SlackInterior, DoesNotTakeSmallProductsForAnAnswer) {
  const MinimaxProblem problem = ProblemFromScene(MakeScene({.noise_px = 0.5}));
  const MinimaxLpResult expected = SolveL1SlackInterior({problem, 0.0, 10.0});
  // A hundred times too large: what it misses outweighs the products at once.
  MinimaxStructure start = expected.structure;
  for (Eigen::Vector3d& center : start.center_in_world) center *= 100.0;
  for (Eigen::Vector3d& point : start.point_in_world) point *= 100.0;
  L1InteriorOptions options;
  options.first_product = 1e-9;
  options.max_iterations = 500;
  const MinimaxLpResult result = SolveL1SlackInterior({problem, 0.0, 10.0}, options, &start);
  if (result.call == LpCallStatus::kCompleted) {
    EXPECT_NEAR(result.objective, expected.objective, 1e-4 * expected.objective);
  }
}

TEST(SolveL1SlackInterior, RefusesWhatIsNoProgram) {
  const MinimaxProblem problem = ProblemFromScene(MakeScene({}));
  EXPECT_THROW(SolveL1SlackInterior({problem, -1.0, 1.0}), std::invalid_argument);
  EXPECT_THROW(SolveL1SlackInterior({problem, 0.01, 1.0, {1.0, 2.0}}), std::invalid_argument);
  EXPECT_THROW(SolveL1SlackInterior({MinimaxProblem(), 0.01, 1.0}), std::invalid_argument);
}

}  // namespace
}  // namespace rotslam
