#include "krot/initialisation/selection.h"

#include <map>

#include <gtest/gtest.h>

#include "tests/scenes/scene.h"

namespace rotslam {
namespace {

TEST(SelectTracks, GivesEveryViewItsShareWithFewTracks) {
  SceneOptions options;
  options.path = ScenePath::kStreet;
  options.num_views = 30;
  options.num_points = 3000;
  const Scene scene = MakeScene(options);
  const std::vector<int> selected = SelectTracks(scene.cam_from_world, scene.tracks, {});
  EXPECT_LT(selected.size(), 500u);
  std::map<FrameId, int> count;
  for (const int t : selected) {
    for (const Observation& observation : scene.tracks[t].observations) ++count[observation.frame];
  }
  ASSERT_EQ(count.size(), 30u);
  for (const auto& [frame, number] : count) EXPECT_GE(number, 40) << frame.value;
}

TEST(SelectTracks, TakesAllWhereThereAreFew) {
  SceneOptions options;
  options.num_points = 20;
  const Scene scene = MakeScene(options);
  EXPECT_EQ(SelectTracks(scene.cam_from_world, scene.tracks, {}).size(), scene.tracks.size());
}

}  // namespace
}  // namespace rotslam
