#include "krot/linear_start.h"

#include <gtest/gtest.h>

#include "tests/krot/problem_from_scene.h"
#include "tests/scenes/alignment.h"
#include "tests/scenes/scene.h"

namespace rotslam {
namespace {

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

TEST(SolveLinearStart, FindsTheTruthOnCleanScenes) {
  for (const ScenePath path : {ScenePath::kRing, ScenePath::kRandom, ScenePath::kStreet}) {
    SceneOptions options;
    options.path = path;
    options.num_views = 20;
    options.num_points = 300;
    const Scene scene = MakeScene(options);
    const auto structure = SolveLinearStart(ProblemFromScene(scene));
    ASSERT_TRUE(structure);
    EXPECT_EQ(structure->center_in_world.front().norm(), 0.0);
    EXPECT_LT(ErrorOf(*structure, scene).max, 1e-6) << static_cast<int>(path);
    EXPECT_LT(MaxBoxResidual(ProblemFromScene(scene), *structure), 1e-6);
  }
}

TEST(SolveLinearStart, StaysNearTheTruthUnderNoise) {
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    SceneOptions options;
    options.path = ScenePath::kStreet;
    options.num_views = 30;
    options.num_points = 1500;
    options.noise_px = 0.7;
    options.rotation_noise_deg = 0.03;
    options.seed = seed;
    const Scene scene = MakeScene(options);
    const auto structure = SolveLinearStart(ProblemFromScene(scene));
    ASSERT_TRUE(structure);
    EXPECT_LT(ErrorOf(*structure, scene).max, 0.2) << seed;  // of 30 m; seeds gave 0.06
  }
}

TEST(SolveLinearStart, SaysNoWithoutParallax) {
  SceneOptions options;
  options.path = ScenePath::kPivot;
  EXPECT_FALSE(SolveLinearStart(ProblemFromScene(MakeScene(options))));
  EXPECT_FALSE(SolveLinearStart({}));
}

}  // namespace
}  // namespace rotslam
