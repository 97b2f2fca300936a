#include "krot/map_bracket.h"

#include <gtest/gtest.h>

#include "krot/bracket/bisection.h"
#include "tests/krot/problem_from_scene.h"
#include "tests/scenes/scene.h"

namespace rotslam {
namespace {

Scene NoisyScene(ScenePath path, double noise_px) {
  SceneOptions options;
  options.path = path;
  options.num_views = 20;
  options.num_points = 600;
  options.noise_px = noise_px;
  return MakeScene(options);
}

// The true poses and points, which bundle adjustment comes near to.
Reconstruction TruthOf(const Scene& scene) {
  return {scene.true_cam_from_world,
          scene.true_center_in_world,
          scene.true_point_in_world,
          scene.tracks};
}

TEST(BracketMap, EnclosesTheLeastLargestResidual) {
  constexpr double kNoisePx = 0.2;
  for (const ScenePath path : {ScenePath::kStreet, ScenePath::kRing, ScenePath::kRandom}) {
    const Scene scene = NoisyScene(path, kNoisePx);
    const MapBracket bracket = BracketMap(TruthOf(scene), scene.camera, {});
    EXPECT_EQ(bracket.status, BisectionStatus::kConverged);
    EXPECT_GT(bracket.gamma_low, 0.0);
    EXPECT_LE(bracket.gamma_low, bracket.gamma_high);
    EXPECT_LE(bracket.gamma_high, bracket.largest_residual);
    EXPECT_GE(bracket.gamma_low, (1.0 - kMapBracketGap) * bracket.gamma_high);
    EXPECT_EQ(bracket.num_observations, NumObservations(scene.tracks));
    EXPECT_EQ(bracket.num_tracks, static_cast<int>(scene.tracks.size()));

    BisectionOptions narrow;
    narrow.relative_gap = 1e-3;
    const BisectionResult exact = MinimiseMaxResidual(ProblemFromScene(scene), narrow);
    EXPECT_LE(bracket.gamma_low, exact.gamma_high);
    EXPECT_GE(bracket.gamma_high, exact.gamma_low);

    // Of thousands of observations the worst is some four deviations off, and more than one after
    // the best of fits; the bound of the start, 4 px, is far away.
    const double px = scene.camera.MeanFocal();
    EXPECT_LT(bracket.largest_residual * px, 6.0 * kNoisePx);
    EXPECT_GT(bracket.gamma_low * px, kNoisePx);
  }
}

TEST(BracketMap, IsNearZeroWithoutNoise) {
  const Scene scene = NoisyScene(ScenePath::kStreet, 0.0);
  const MapBracket bracket = BracketMap(TruthOf(scene), scene.camera, {});
  EXPECT_LE(bracket.gamma_low, bracket.gamma_high);
  EXPECT_LT(bracket.largest_residual, 1e-9);
}

TEST(BracketMap, ProvesNothingUnasked) {
  const Scene scene = NoisyScene(ScenePath::kStreet, 0.2);
  KrotOptions off;
  off.use_bracket = false;
  KrotOptions too_many;
  too_many.max_bracket_views = 19;
  for (const KrotOptions& options : {off, too_many}) {
    const MapBracket bracket = BracketMap(TruthOf(scene), scene.camera, options);
    EXPECT_EQ(bracket.gamma_low, 0.0);
    EXPECT_EQ(bracket.gamma_high, bracket.largest_residual);
    EXPECT_GT(bracket.largest_residual, 0.0);
    EXPECT_EQ(bracket.num_programs, 0);
  }
}

TEST(BracketMap, IsZeroOfAnEmptyMap) {
  const MapBracket bracket = BracketMap({}, NoisyScene(ScenePath::kRing, 0.0).camera, {});
  EXPECT_EQ(bracket.num_observations, 0);
  EXPECT_EQ(bracket.gamma_high, 0.0);
}

// What is not of the map, or far off the axis, is not covered.
TEST(BracketMap, LeavesOutWhatHasNoPoint) {
  const Scene scene = NoisyScene(ScenePath::kStreet, 0.2);
  Reconstruction map = TruthOf(scene);
  map.point_in_world.erase(map.tracks.front().id);
  const MapBracket bracket = BracketMap(map, scene.camera, {});
  EXPECT_EQ(bracket.num_tracks, static_cast<int>(scene.tracks.size()) - 1);
}

}  // namespace
}  // namespace rotslam
