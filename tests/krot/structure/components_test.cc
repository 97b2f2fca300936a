#include "krot/structure/components.h"

#include <gtest/gtest.h>

#include "krot/initialisation/epipolar_filter.h"
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

// Two walks of four steps beside things at 5 m, each seen by one walk, and in front of `num_far`
// points so far that a walk's ends see them 1.4 px apart.
Scene TwoWalks(int num_far) {
  Scene scene;
  for (int frame = 0; frame < 8; ++frame) {
    scene.cam_from_world[FrameId{frame}] = Rotation();
    scene.true_center_in_world[FrameId{frame}] = {1.0 * frame, 0.0, 0.0};
  }
  SceneRandom random(1);
  const auto add = [&](const Eigen::Vector3d& point, int first, int last) {
    Track& track = scene.tracks.emplace_back();
    track.id = TrackId{static_cast<int>(scene.tracks.size())};
    for (int frame = first; frame <= last; ++frame) {
      const Eigen::Vector3d ray = point - scene.true_center_in_world.at(FrameId{frame});
      track.observations.push_back({FrameId{frame}, Eigen::Vector2d::Zero(), ray.normalized()});
    }
  };
  for (int n = 0; n < 20; ++n) {
    add({random.Uniform(0.0, 3.0), random.Uniform(-2.0, 2.0), 5.0}, 0, 3);
    add({random.Uniform(4.0, 7.0), random.Uniform(-2.0, 2.0), 5.0}, 4, 7);
  }
  for (int n = 0; n < num_far; ++n) {
    add({random.Uniform(-500.0, 500.0), random.Uniform(-500.0, 500.0), 1500.0}, 0, 7);
  }
  return scene;
}

std::size_t NumComponents(int num_far, double noise_px) {
  const Scene scene = TwoWalks(num_far);
  ComponentOptions options = Defaults();
  for (const auto& [frame, rotation] : scene.cam_from_world) {
    options.noise_rad[frame] = noise_px / 700.0;
  }
  return FindComponents(scene.cam_from_world, scene.tracks, options).size();
}

TEST(FindComponents, ManyShallowPointsJoinWhereTheyAreMoreThanNoise) {
  EXPECT_EQ(NumComponents(200, 0.1), 1u);
  EXPECT_EQ(NumComponents(50, 0.1), 2u);   // an eighth of a point each
  EXPECT_EQ(NumComponents(200, 0.5), 2u);  // 1.4 px are noise then
  const Scene unknown = TwoWalks(200);
  EXPECT_EQ(FindComponents(unknown.cam_from_world, unknown.tracks, Defaults()).size(), 2u);
}

TEST(FindComponents, APivotOfKnownNoiseHasNone) {
  SceneOptions options;
  options.path = ScenePath::kPivot;
  options.noise_px = 0.2;
  const Scene scene = MakeScene(options);
  ComponentOptions known = Defaults();
  known.noise_rad = TestEpipolarPlanes(scene.cam_from_world, scene.tracks, {}).noise_rad;
  EXPECT_EQ(known.noise_rad.size(), scene.cam_from_world.size());
  EXPECT_TRUE(FindComponents(scene.cam_from_world, scene.tracks, known).empty());
}

}  // namespace
}  // namespace rotslam
