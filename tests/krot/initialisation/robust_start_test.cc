#include "krot/initialisation/robust_start.h"

#include <gtest/gtest.h>

#include "tests/krot/problem_from_scene.h"

namespace rotslam {
namespace {

struct Tally {
  int inliers = 0;
  int inliers_kept = 0;
  int outliers = 0;
  int outliers_caught = 0;
};

Tally Count(const Scene& scene, const MinimaxProblem& problem, const RobustStart& start) {
  Tally tally;
  for (std::size_t o = 0; o < problem.observations.size(); ++o) {
    const ImageObservation& observation = problem.observations[o];
    const bool caught = start.residuals[o] > 8.0 / 700.0;
    if (scene.outliers.contains({scene.tracks[observation.point].id, FrameId{observation.view}})) {
      ++tally.outliers;
      tally.outliers_caught += caught;
    } else {
      ++tally.inliers;
      tally.inliers_kept += !caught;
    }
  }
  return tally;
}

TEST(SolveRobustStart, OutliersBuySlackAndInliersKeepTheTruth) {
  for (const ScenePath path : {ScenePath::kRandom, ScenePath::kStreet}) {
    for (const double ratio : {0.01, 0.05, 0.1}) {
      SceneOptions options;
      options.path = path;
      options.num_views = path == ScenePath::kStreet ? 20 : 8;
      options.num_points = path == ScenePath::kStreet ? 200 : 120;
      options.noise_px = 0.5;
      options.outlier_ratio = ratio;
      const Scene scene = MakeScene(options);
      const MinimaxProblem problem = ProblemFromScene(scene);
      const RobustStart start = SolveRobustStart(problem, 4.0 / 700.0);
      ASSERT_EQ(start.call, LpCallStatus::kCompleted);
      const Tally tally = Count(scene, problem, start);
      EXPECT_GE(tally.outliers_caught, 0.95 * tally.outliers) << ratio;
      EXPECT_GE(tally.inliers_kept, 0.98 * tally.inliers) << ratio;
    }
  }
}

TEST(SolveRobustStart, OneRoundAndASharpeningWithoutOutliers) {
  SceneOptions options;
  options.num_views = 6;
  options.num_points = 60;
  options.noise_px = 0.5;
  const RobustStart start = SolveRobustStart(ProblemFromScene(MakeScene(options)), 4.0 / 700.0);
  EXPECT_EQ(start.num_programs, 2);
}

TEST(SolveRobustStart, RefusesABoundOfZero) {
  const MinimaxProblem problem = ProblemFromScene(MakeScene({}));
  EXPECT_THROW(SolveRobustStart(problem, 0.0), std::invalid_argument);
}

}  // namespace
}  // namespace rotslam
