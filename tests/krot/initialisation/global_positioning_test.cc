#include "krot/initialisation/global_positioning.h"

#include <gtest/gtest.h>

#include "tests/krot/problem_from_scene.h"
#include "tests/scenes/alignment.h"
#include "tests/scenes/scene.h"

namespace rotslam {
namespace {

constexpr double kLossRad = 8.0 / 700.0;

CenterError ErrorOf(const MinimaxStructure& structure, const Scene& scene) {
  CenterMap centers;
  int view = 0;
  for (const auto& [frame, rotation] : scene.cam_from_world) {
    centers[frame] = structure.center_in_world[view++];
  }
  return CompareCenters(centers,
                        scene.true_center_in_world,
                        AlignCentersKnownRotation(centers, scene.true_center_in_world));
}

TEST(SolveGlobalPositioning, FindsTheTruthOnCleanScenes) {
  for (const ScenePath path : {ScenePath::kRing, ScenePath::kRandom, ScenePath::kStreet}) {
    SceneOptions options;
    options.path = path;
    options.num_views = 20;
    options.num_points = 300;
    const Scene scene = MakeScene(options);
    const auto structure = SolveGlobalPositioning(ProblemFromScene(scene), kLossRad);
    ASSERT_TRUE(structure);
    EXPECT_EQ(structure->center_in_world.front().norm(), 0.0);
    EXPECT_LT(ErrorOf(*structure, scene).max, 1e-6) << static_cast<int>(path);
    EXPECT_LT(MaxBoxResidual(ProblemFromScene(scene), *structure), 1e-6);
  }
}

// Along a street, where scale hangs on what neighbours share, and around a ring.
TEST(SolveGlobalPositioning, StaysNearTheTruthUnderNoiseAndOutliers) {
  for (const ScenePath path : {ScenePath::kRing, ScenePath::kStreet}) {
    for (const double ratio : {0.0, 0.3}) {
      for (const std::uint64_t seed : {1U, 2U, 3U}) {
        SceneOptions options;
        options.path = path;
        options.num_views = 30;
        options.num_points = 600;
        options.noise_px = 0.7;
        options.rotation_noise_deg = 0.03;
        options.outlier_ratio = ratio;
        options.seed = seed;
        const Scene scene = MakeScene(options);
        const auto structure = SolveGlobalPositioning(ProblemFromScene(scene), kLossRad);
        ASSERT_TRUE(structure);
        // Of a ring 12 m across and a street of 30 m; the worst of these are 0.0046 and 0.018.
        EXPECT_LT(ErrorOf(*structure, scene).rmse, path == ScenePath::kRing ? 0.007 : 0.03)
            << seed << " " << ratio;
      }
    }
  }
}

// All depths fit then.
TEST(SolveGlobalPositioning, WithoutParallaxNothingMoves) {
  SceneOptions options;
  options.path = ScenePath::kPivot;
  const auto structure = SolveGlobalPositioning(ProblemFromScene(MakeScene(options)), kLossRad);
  ASSERT_TRUE(structure);
  for (const Eigen::Vector3d& center : structure->center_in_world) EXPECT_LT(center.norm(), 1e-9);
}

TEST(SolveGlobalPositioning, RefusesWhatItCannotDo) {
  EXPECT_FALSE(SolveGlobalPositioning({}, kLossRad));
  MinimaxProblem problem = ProblemFromScene(MakeScene({}));
  EXPECT_THROW(SolveGlobalPositioning(problem, 0.0), std::invalid_argument);
  problem.view_fixed.assign(problem.num_views(), false);
  EXPECT_THROW(SolveGlobalPositioning(problem, kLossRad), std::invalid_argument);
}

}  // namespace
}  // namespace rotslam
