#include "krot/initialisation/register_views.h"

#include <algorithm>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/scenes/scene.h"

namespace rotslam {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

std::vector<FrameId> AllViews(const Scene& scene) {
  std::vector<FrameId> views;
  for (const auto& [frame, rotation] : scene.cam_from_world) views.push_back(frame);
  return views;
}

// The true centres of the first views.
CenterMap FirstCenters(const Scene& scene, int count) {
  CenterMap centers;
  for (int k = 0; k < count; ++k) {
    centers[FrameId{k}] = scene.true_center_in_world.at(FrameId{k});
  }
  return centers;
}

double LargestRegistrationError(const CenterMap& centers, const Scene& scene) {
  double largest = 0.0;
  for (const auto& [frame, center] : centers) {
    largest = std::max(largest, (center - scene.true_center_in_world.at(frame)).norm());
  }
  return largest;
}

Scene CleanOrNoisyStreet(double noise_px, double outlier_ratio) {
  SceneOptions options;
  options.path = ScenePath::kStreet;
  options.num_views = 20;
  options.num_points = 600;
  options.noise_px = noise_px;
  options.outlier_ratio = outlier_ratio;
  return MakeScene(options);
}

void KeepObservations(Scene& scene, FrameId view, int count) {
  for (Track& track : scene.tracks) {
    std::erase_if(track.observations, [&](const Observation& observation) {
      return observation.frame == view && count-- <= 0;
    });
  }
}

TEST(RegisterViews, FindsEveryViewExactlyOnACleanScene) {
  SceneOptions options;
  options.num_views = 10;
  options.num_points = 100;
  const Scene scene = MakeScene(options);
  CenterMap centers = FirstCenters(scene, 3);
  EXPECT_THAT(RegisterViews(scene.cam_from_world, scene.tracks, AllViews(scene), {}, centers),
              IsEmpty());
  EXPECT_EQ(centers.size(), 10U);
  EXPECT_LT(LargestRegistrationError(centers, scene), 1e-8);
}

// The last views see nothing that the first ones do: points must be intersected on the way, and
// what comes first in the order must wait.
TEST(RegisterViews, WorksAlongAStreetInAnyOrder) {
  const Scene scene = CleanOrNoisyStreet(0.0, 0.0);
  for (const Track& track : scene.tracks) {
    if (track.observations.front().frame.value > 2) continue;
    EXPECT_LT(track.observations.back().frame.value, 19) << "else the test says little";
  }
  for (const bool reversed : {false, true}) {
    std::vector<FrameId> order = AllViews(scene);
    if (reversed) std::reverse(order.begin(), order.end());
    CenterMap centers = FirstCenters(scene, 3);
    EXPECT_THAT(RegisterViews(scene.cam_from_world, scene.tracks, order, {}, centers), IsEmpty());
    EXPECT_LT(LargestRegistrationError(centers, scene), 1e-6) << reversed;
  }
}

TEST(RegisterViews, ForgivesNoiseAndOutliers) {
  const Scene scene = CleanOrNoisyStreet(0.5, 0.1);
  CenterMap centers = FirstCenters(scene, 3);
  EXPECT_THAT(RegisterViews(scene.cam_from_world, scene.tracks, AllViews(scene), {}, centers),
              IsEmpty());
  EXPECT_LT(LargestRegistrationError(centers, scene), 0.5) << "over 20 m";
}

TEST(RegisterViews, NamesViewsThatSeeTooLittle) {
  Scene scene = CleanOrNoisyStreet(0.0, 0.0);
  const RegistrationOptions options;
  KeepObservations(scene, FrameId{10}, options.min_points - 1);
  KeepObservations(scene, FrameId{12}, 0);
  CenterMap centers = FirstCenters(scene, 3);
  EXPECT_THAT(RegisterViews(scene.cam_from_world, scene.tracks, AllViews(scene), options, centers),
              ElementsAre(FrameId{10}, FrameId{12}));
  EXPECT_EQ(centers.size(), 18U);
  RegistrationOptions fewer = options;
  fewer.min_points = options.min_points - 2;
  EXPECT_THAT(RegisterViews(scene.cam_from_world, scene.tracks, AllViews(scene), fewer, centers),
              ElementsAre(FrameId{12}));
}

TEST(RegisterViews, LeavesKnownCentresAlone) {
  const Scene scene = CleanOrNoisyStreet(0.5, 0.0);
  CenterMap centers = FirstCenters(scene, 4);
  const CenterMap before = centers;
  RegisterViews(scene.cam_from_world, scene.tracks, AllViews(scene), {}, centers);
  for (const auto& [frame, center] : before) EXPECT_EQ(centers.at(frame), center);
}

TEST(PosedRays, AreThoseWithACentre) {
  const Scene scene = CleanOrNoisyStreet(0.0, 0.0);
  Track track = *std::ranges::find_if(scene.tracks, [](const Track& one) {
    return one.observations.size() >= 3 && one.observations[1].frame.value < 10;
  });
  track.observations[0].sigma_px = 2.0;
  CenterMap centers = scene.true_center_in_world;
  centers.erase(track.observations[1].frame);
  std::vector<int> positions;
  const std::vector<PosedRay> rays =
      PosedRays(scene.cam_from_world, centers, track, 700.0, &positions);
  ASSERT_EQ(rays.size(), track.observations.size() - 1);
  EXPECT_EQ(positions[0], 0);
  EXPECT_EQ(positions[1], 2);
  EXPECT_EQ(rays[0].center_in_world, centers.at(track.observations[0].frame));
  EXPECT_EQ(rays[0].bearing, track.observations[0].bearing);
}

}  // namespace
}  // namespace rotslam
