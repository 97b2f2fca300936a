#include "apps/slam/map/resect_frames.h"

#include <gtest/gtest.h>

#include "tests/scenes/scene.h"

namespace rotslam {
namespace {

TEST(InterpolatedCenter, IsLinearInTime) {
  const std::vector<double> timestamps_s = {0.0, 0.1, 0.4, 0.5, 0.6};
  const CenterMap centers = {{FrameId{1}, {1.0, 0.0, 0.0}}, {FrameId{3}, {5.0, 4.0, 0.0}}};
  const auto at = [&](int frame) {
    return InterpolatedCenter(centers, timestamps_s, FrameId{frame});
  };
  EXPECT_TRUE(at(2).isApprox(Eigen::Vector3d(4.0, 3.0, 0.0), 1e-12));
  EXPECT_EQ(at(3), centers.at(FrameId{3}));
  EXPECT_EQ(at(0), centers.at(FrameId{1})) << "before the first one";
  EXPECT_EQ(at(4), centers.at(FrameId{3})) << "behind the last one";
}

Scene NoisyRing() {
  SceneOptions options;
  options.num_views = 8;
  options.num_points = 150;
  options.noise_px = 0.3;
  return MakeScene(options);
}

// Where the search begins: a little off the truth.
std::map<FrameId, ResectionStart> StartsOf(const Scene& scene) {
  std::map<FrameId, ResectionStart> starts;
  for (const auto& [frame, rotation] : scene.true_cam_from_world) {
    starts[frame].cam_from_world = Rotation::Exp({0.01, -0.01, 0.01}) * rotation;
    starts[frame].center_in_world =
        scene.true_center_in_world.at(frame) + Eigen::Vector3d(0.1, 0.1, -0.1);
  }
  return starts;
}

TEST(ResectFrames, FindsPosesFromThePointsThatTheFramesSee) {
  const Scene scene = NoisyRing();
  const auto poses =
      ResectFrames(StartsOf(scene), {scene.true_point_in_world, scene.tracks}, scene.camera, {}, 2);
  ASSERT_EQ(poses.size(), 8U);
  for (const auto& [frame, pose] : poses) {
    EXPECT_LT((pose.center_in_world - scene.true_center_in_world.at(frame)).norm(), 0.01);
    const Rotation error = pose.cam_from_world * scene.true_cam_from_world.at(frame).Inverse();
    EXPECT_LT(error.AngleDeg(), 0.1);
  }
}

TEST(ResectFrames, LeavesOutFramesThatSeeTooLittle) {
  Scene scene = NoisyRing();
  PointMap points = scene.true_point_in_world;
  const FrameId lonely{3};
  for (const Track& track : scene.tracks) {
    for (const Observation& observation : track.observations) {
      if (observation.frame == lonely && points.size() > 30) points.erase(track.id);
    }
  }
  for (Track& track : scene.tracks) {
    if (!points.contains(track.id)) continue;
    std::erase_if(track.observations, [&](const Observation& observation) {
      return observation.frame == lonely && track.id.value % 40 != 0;
    });
  }
  auto starts = StartsOf(scene);
  starts.erase(FrameId{0});
  const auto poses = ResectFrames(starts, {points, scene.tracks}, scene.camera, {}, 1);
  EXPECT_FALSE(poses.contains(lonely));
  EXPECT_FALSE(poses.contains(FrameId{0})) << "not asked for";
  EXPECT_EQ(poses.size(), 6U);
}

}  // namespace
}  // namespace rotslam
