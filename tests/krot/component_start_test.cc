#include "krot/component_start.h"

#include <cmath>
#include <optional>
#include <vector>

#include <gtest/gtest.h>

#include "tests/scenes/alignment.h"
#include "tests/scenes/scene.h"

namespace rotslam {
namespace {

Scene StreetOf(int num_views) {
  SceneOptions options;
  options.path = ScenePath::kStreet;
  options.num_views = num_views;
  options.num_points = 25 * num_views;
  options.noise_px = 0.5;
  options.rotation_noise_deg = 0.02;
  options.outlier_ratio = 0.02;
  return MakeScene(options);
}

std::optional<ComponentStart> StartOf(const Scene& scene, const KrotOptions& options) {
  const KrotUnits units(options, scene.camera);
  ComponentOptions component_options;
  component_options.min_parallax_rad = units.point_angle_rad;
  const std::vector<ViewComponent> components =
      FindComponents(scene.cam_from_world, scene.tracks, component_options);
  EXPECT_EQ(components.size(), 1U);
  if (components.empty()) return std::nullopt;
  EXPECT_EQ(components[0].views.size(), scene.cam_from_world.size());
  return StartComponent(
      {scene.cam_from_world, scene.tracks, options, units}, components[0], component_options);
}

double LargestStartError(const CenterMap& centers, const Scene& scene) {
  const CenterMap& truth = scene.true_center_in_world;
  return CompareCenters(centers, truth, AlignCentersKnownRotation(centers, truth)).max;
}

TEST(StartComponent, FindsCentresByPrograms) {
  const Scene scene = StreetOf(24);
  const auto start = StartOf(scene, {});
  ASSERT_TRUE(start.has_value());
  EXPECT_EQ(start->centers.size(), 24U);
  EXPECT_EQ(start->num_grown_views, 0);
  EXPECT_GE(start->num_programs, 2);
  EXPECT_LT(LargestStartError(start->centers, scene), 0.15) << "over 23 m";
}

TEST(StartComponent, FindsCentresByGlobalPositioning) {
  const Scene scene = StreetOf(24);
  KrotOptions options;
  options.start = KrotStart::kPositioning;
  const auto start = StartOf(scene, options);
  ASSERT_TRUE(start.has_value());
  EXPECT_EQ(start->centers.size(), 24U);
  EXPECT_EQ(start->num_programs, 0);
  EXPECT_LT(LargestStartError(start->centers, scene), 0.15);
}

TEST(StartComponent, JoinsBlocksOfALongComponent) {
  const Scene scene = StreetOf(48);
  KrotOptions options;
  const auto whole = StartOf(scene, options);
  options.max_lp_views = 16;
  const auto blocks = StartOf(scene, options);
  ASSERT_TRUE(whole.has_value() && blocks.has_value());
  EXPECT_EQ(blocks->centers.size(), 48U);
  EXPECT_GE(blocks->num_programs, 2 * whole->num_programs) << "several blocks";
  EXPECT_LT(LargestStartError(blocks->centers, scene), 1.0) << "over 47 m";
}

// One view looks along its axis at nothing: all that it sees lies beyond 80 deg, where the programs
// do not look.
TEST(StartComponent, PlacesWhatTheProgramsLeaveOutByResection) {
  Scene scene = StreetOf(24);
  const FrameId view{11};
  const KrotOptions options;
  const double least_z = std::cos(80.0 * kRadFromDeg);
  const Rotation turned = Rotation::Exp(90.0 * kRadFromDeg * Eigen::Vector3d::UnitY());
  scene.cam_from_world.at(view) = turned * scene.cam_from_world.at(view);
  for (Track& track : scene.tracks) {
    for (Observation& observation : track.observations) {
      if (observation.frame == view) observation.bearing = turned * observation.bearing;
    }
    std::erase_if(track.observations, [&](const Observation& observation) {
      return observation.frame == view && observation.bearing.z() >= least_z;
    });
  }
  std::erase_if(scene.tracks, [](const Track& track) { return track.observations.size() < 2; });
  const auto start = StartOf(scene, options);
  ASSERT_TRUE(start.has_value());
  EXPECT_EQ(start->num_grown_views, 1);
  ASSERT_TRUE(start->centers.contains(view));
  EXPECT_LT(LargestStartError(start->centers, scene), 0.3);
}

TEST(StartComponent, IsNothingWithoutTracks) {
  Scene scene = StreetOf(8);
  ViewComponent component;
  for (const auto& [frame, rotation] : scene.cam_from_world) component.views.push_back(frame);
  const KrotOptions options;
  const KrotUnits units(options, scene.camera);
  const std::vector<Track> tracks;
  EXPECT_FALSE(
      StartComponent({scene.cam_from_world, tracks, options, units}, component, {}).has_value());
}

}  // namespace
}  // namespace rotslam
