#include "krot/structure/minimax_lp.h"

#include <gtest/gtest.h>

#include "tests/krot/problem_from_scene.h"

namespace rotslam {
namespace {

SceneOptions SmallNoisy() {
  SceneOptions options;
  options.num_views = 5;
  options.num_points = 20;
  options.noise_px = 1.0;
  options.path = ScenePath::kRandom;
  return options;
}

MinimaxStructure TrueStructure(const Scene& scene) {
  MinimaxStructure structure;
  for (const auto& [frame, center] : scene.true_center_in_world) {
    structure.center_in_world.push_back(center);
  }
  for (const auto& [track, point] : scene.true_point_in_world) {
    structure.point_in_world.push_back(point);
  }
  return structure;
}

TEST(MaxBoxResidual, IsZeroAtTheTruthAndInfiniteBehindACamera) {
  SceneOptions options = SmallNoisy();
  options.noise_px = 0.0;
  const Scene scene = MakeScene(options);
  const MinimaxProblem problem = ProblemFromScene(scene);
  MinimaxStructure structure = TrueStructure(scene);
  EXPECT_LT(MaxBoxResidual(problem, structure), 1e-12);
  structure.point_in_world[3] = Eigen::Vector3d(0, 0, -50);
  EXPECT_EQ(MaxBoxResidual(problem, structure), kInfinity);
}

TEST(SolveFeasibility, FeasibleAtGammaImpliesFeasibleAbove) {
  const MinimaxProblem problem = ProblemFromScene(MakeScene(SmallNoisy()));
  for (const LpEngine engine : {LpEngine::kClp, LpEngine::kGlpk}) {
    if (!HasLpEngine(engine)) continue;
    LpOptions options;
    options.engine = engine;
    bool was_feasible = false;
    int num_feasible = 0;
    int num_infeasible = 0;
    for (double gamma_px = 0.25; gamma_px < 16.0; gamma_px *= 1.3) {
      const double gamma = gamma_px / 700.0;
      const MinimaxLpResult lp = SolveFeasibility(problem, gamma, options);
      ASSERT_EQ(lp.call, LpCallStatus::kCompleted);
      const bool feasible = MaxBoxResidual(problem, lp.structure) <= gamma;
      const bool infeasible = CertifiesInfeasible(problem, gamma, lp.multipliers, 1e6);
      EXPECT_NE(feasible, infeasible) << gamma_px;
      EXPECT_TRUE(feasible || !was_feasible) << gamma_px;
      was_feasible = feasible;
      num_feasible += feasible;
      num_infeasible += infeasible;
    }
    EXPECT_GT(num_feasible, 2);
    EXPECT_GT(num_infeasible, 2);
  }
}

TEST(CertifiesInfeasible, NeverBelievesWhatATruthContradicts) {
  // At a gamma the truth attains, no multipliers whatever may pass.
  const Scene scene = MakeScene(SmallNoisy());
  const MinimaxProblem problem = ProblemFromScene(scene);
  const double attained = 1.001 * MaxBoxResidual(problem, TrueStructure(scene));
  const std::vector<double> honest = SolveFeasibility(problem, 0.1 * attained).multipliers;
  EXPECT_TRUE(CertifiesInfeasible(problem, 0.1 * attained, honest, 1e6));
  EXPECT_FALSE(CertifiesInfeasible(problem, attained, honest, 1e6));
  SceneRandom random(7);
  for (int trial = 0; trial < 20; ++trial) {
    std::vector<double> made_up(5 * problem.observations.size());
    for (double& y : made_up) y = random.Uniform(0.0, 1.0);
    EXPECT_FALSE(CertifiesInfeasible(problem, attained, made_up, 1e6));
  }
  EXPECT_FALSE(CertifiesInfeasible(problem, attained, {}, 1e6));
  EXPECT_FALSE(CertifiesInfeasible(
      problem, 0.0, std::vector<double>(5 * problem.observations.size(), 0.0), 1e6));
}

}  // namespace
}  // namespace rotslam
