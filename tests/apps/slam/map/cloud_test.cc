#include "apps/slam/map/cloud.h"

#include <gtest/gtest.h>

#include "tests/scenes/scene.h"

namespace rotslam {
namespace {

Scene RingForCloud() {
  SceneOptions options;
  options.num_views = 8;
  options.num_points = 200;
  options.noise_px = 0.3;
  return MakeScene(options);
}

TEST(MakeCloudOf, TriangulatesTracksWithoutAPoint) {
  const Scene scene = RingForCloud();
  PointMap known = scene.true_point_in_world;
  std::erase_if(known, [](const auto& entry) { return entry.first.value % 4 != 0; });
  const Reconstruction cloud =
      MakeCloudOf({scene.camera, scene.true_cam_from_world, scene.true_center_in_world, known, {}},
                  scene.tracks,
                  {});
  EXPECT_GT(cloud.point_in_world.size(), 0.95 * static_cast<double>(scene.tracks.size()));
  for (const auto& [track, point] : cloud.point_in_world) {
    EXPECT_LT((point - scene.true_point_in_world.at(track)).norm(), 0.05);
  }
  EXPECT_EQ(cloud.cam_from_world.size(), 8U);
  for (const auto& [frame, center] : scene.true_center_in_world) {
    EXPECT_EQ(cloud.center_in_world.at(frame), center) << "poses stay";
  }
}

TEST(MakeCloudOf, LeavesOutShortTracks) {
  Scene scene = RingForCloud();
  Track& track = scene.tracks.front();
  track.observations.resize(2);
  const Reconstruction cloud =
      MakeCloudOf({scene.camera, scene.true_cam_from_world, scene.true_center_in_world, {}, {}},
                  scene.tracks,
                  {});
  EXPECT_FALSE(cloud.point_in_world.contains(track.id));
  EXPECT_TRUE(cloud.point_in_world.contains(scene.tracks[1].id));
}

// What only frames of a segment see has no depth, though their centres may differ a little.
TEST(MakeCloudOf, TakesNoDepthFromWithinASegment) {
  Scene scene = RingForCloud();
  for (Track& track : scene.tracks) {
    std::erase_if(track.observations, [](const Observation& one) { return one.frame.value > 3; });
  }
  const auto num_points = [&](const std::vector<PureRotationSegment>& held) {
    return MakeCloudOf(
               {scene.camera, scene.true_cam_from_world, scene.true_center_in_world, {}, held},
               scene.tracks,
               {})
        .point_in_world.size();
  };
  EXPECT_GT(num_points({}), 100U);
  EXPECT_EQ(num_points({{FrameId{0}, FrameId{3}, 1.0}}), 0U);
}

}  // namespace
}  // namespace rotslam
