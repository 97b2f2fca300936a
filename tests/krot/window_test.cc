#include "krot/window.h"

#include <gtest/gtest.h>

#include "tests/scenes/alignment.h"
#include "tests/scenes/scene.h"

namespace rotslam {
namespace {

// Tracks as a stream has them once `last` is there, those alone that new views see.
std::vector<Track> TracksUntil(const Scene& scene, int last, int first_new) {
  std::vector<Track> tracks;
  for (const Track& whole : scene.tracks) {
    Track track = whole;
    std::erase_if(track.observations,
                  [&](const Observation& observation) { return observation.frame.value > last; });
    if (track.observations.size() < 2) continue;
    if (track.observations.back().frame.value >= first_new) tracks.push_back(std::move(track));
  }
  return tracks;
}

double MaxErrorOf(const KrotSolution& solution, const Scene& scene) {
  return CompareCenters(
             solution.center_in_world,
             scene.true_center_in_world,
             AlignCentersKnownRotation(solution.center_in_world, scene.true_center_in_world))
      .max;
}

Scene Street(double noise_px, double outlier_ratio) {
  SceneOptions options;
  options.path = ScenePath::kStreet;
  options.num_views = 40;
  options.num_points = 2000;
  options.noise_px = noise_px;
  options.outlier_ratio = outlier_ratio;
  return MakeScene(options);
}

KrotSolution Stream(const Scene& scene, int window) {
  KrotOptions options;
  options.use_bracket = false;
  int next = 20;
  KrotSolution solution = SolveKnownRotation(
      scene.cam_from_world, TracksUntil(scene, next - 1, 0), scene.camera, options);
  for (; next < 40; next += window) {
    const int last = std::min(39, next + window - 1);
    const KrotSolution known = solution;
    solution = ExtendKnownRotation(
        known, scene.cam_from_world, TracksUntil(scene, last, next), scene.camera, options);
    EXPECT_NE(solution.status, KrotStatus::kInfeasible) << solution.message;
    // What is known stays to the last bit.
    for (const auto& [view, center] : known.center_in_world) {
      EXPECT_EQ(solution.center_in_world.at(view), center);
    }
    for (const auto& [track, point] : known.point_in_world) {
      EXPECT_EQ(solution.point_in_world.at(track), point);
    }
    EXPECT_LE(solution.gamma_high, options.loose_factor * options.threshold_px / 700.0 + 1e-12);
  }
  return solution;
}

TEST(ExtendKnownRotation, FindsTheTruthOnACleanStreet) {
  const Scene scene = Street(0.0, 0.0);
  for (const int window : {1, 5}) {
    const KrotSolution solution = Stream(scene, window);
    EXPECT_EQ(solution.center_in_world.size(), 40u);
    EXPECT_LT(MaxErrorOf(solution, scene), 1e-4) << window;
  }
}

TEST(ExtendKnownRotation, FollowsANoisyStreetWithOutliers) {
  const Scene scene = Street(0.5, 0.05);
  const KrotSolution solution = Stream(scene, 5);
  EXPECT_EQ(solution.center_in_world.size(), 40u);
  EXPECT_LT(MaxErrorOf(solution, scene), 0.6);  // of 40 m; seed 1 gave 0.28
  EXPECT_GT(solution.point_in_world.size(), 1800u);
}

TEST(ExtendKnownRotation, AddsNothingWhereNothingIsShared) {
  const Scene scene = Street(0.5, 0.0);
  KrotOptions options;
  options.use_bracket = false;
  const KrotSolution known =
      SolveKnownRotation(scene.cam_from_world, TracksUntil(scene, 9, 0), scene.camera, options);
  std::vector<Track> far = TracksUntil(scene, 39, 35);
  for (Track& track : far) {
    std::erase_if(track.observations,
                  [](const auto& observation) { return observation.frame.value < 30; });
  }
  std::erase_if(far, [](const Track& track) { return track.observations.size() < 2; });
  const KrotSolution solution =
      ExtendKnownRotation(known, scene.cam_from_world, far, scene.camera, options);
  EXPECT_EQ(solution.status, KrotStatus::kInfeasible);
  EXPECT_EQ(solution.center_in_world.size(), known.center_in_world.size());
  options.loose_factor = 0.5;
  EXPECT_THROW(ExtendKnownRotation(known, scene.cam_from_world, far, scene.camera, options),
               std::invalid_argument);
}

}  // namespace
}  // namespace rotslam
