#include "krot/components.h"

#include <gtest/gtest.h>

#include "tests/scenes/scene.h"

namespace rotslam {
namespace {

ComponentOptions Defaults() {
  ComponentOptions options;
  options.min_parallax_rad = 4.0 / 700.0;
  return options;
}

// Two scenes side by side: the second one's frames and tracks carry on the first one's numbers.
void Append(const Scene& other, Scene& scene) {
  const int frames = static_cast<int>(scene.cam_from_world.size());
  for (const auto& [frame, rotation] : other.cam_from_world) {
    scene.cam_from_world[FrameId{frame.value + frames}] = rotation;
  }
  for (Track track : other.tracks) {
    track.id.value += 100000;
    for (Observation& observation : track.observations) observation.frame.value += frames;
    scene.tracks.push_back(std::move(track));
  }
}

TEST(FindComponents, ARingIsOnePiece) {
  SceneOptions options;
  options.num_views = 12;
  const Scene scene = MakeScene(options);
  const auto components = FindComponents(scene.cam_from_world, scene.tracks, Defaults());
  ASSERT_EQ(components.size(), 1u);
  EXPECT_EQ(components[0].views.size(), 12u);
}

TEST(FindComponents, ScenesWithoutSharedTracksComeApartLargestFirst) {
  SceneOptions options;
  options.num_views = 6;
  Scene scene = MakeScene(options);
  options.num_views = 9;
  options.seed = 2;
  Append(MakeScene(options), scene);
  const auto components = FindComponents(scene.cam_from_world, scene.tracks, Defaults());
  ASSERT_EQ(components.size(), 2u);
  EXPECT_EQ(components[0].views.size(), 9u);
  EXPECT_EQ(components[1].views.size(), 6u);
}

TEST(FindComponents, APivotHasNone) {
  SceneOptions options;
  options.path = ScenePath::kPivot;
  options.noise_px = 0.5;
  const Scene scene = MakeScene(options);
  EXPECT_TRUE(FindComponents(scene.cam_from_world, scene.tracks, Defaults()).empty());
}

TEST(FindComponents, TooFewSharedPointsDoNotJoin) {
  // Two halves of a street linked by tracks that the second half sees too few of.
  SceneOptions options;
  options.path = ScenePath::kStreet;
  options.num_views = 20;
  options.num_points = 1500;
  Scene scene = MakeScene(options);
  std::vector<Track> cut;
  int bridges = 0;
  for (const Track& track : scene.tracks) {
    const bool crosses = track.observations.front().frame < FrameId{10} &&
                         track.observations.back().frame >= FrameId{10};
    if (!crosses || bridges++ < 4) cut.push_back(track);
  }
  EXPECT_EQ(FindComponents(scene.cam_from_world, scene.tracks, Defaults()).size(), 1u);
  EXPECT_EQ(FindComponents(scene.cam_from_world, cut, Defaults()).size(), 2u);
}

}  // namespace
}  // namespace rotslam
