#include "ba/window.h"

#include <gtest/gtest.h>

#include "tests/ba/ba_scene.h"

namespace rotslam {
namespace {

std::set<FrameId> Frames(int first, int last) {
  std::set<FrameId> frames;
  for (int k = first; k <= last; ++k) frames.insert(FrameId{k});
  return frames;
}

TEST(WindowProblem, MovesTheNewestFramesOntoWhatStands) {
  const BaScene scene = MakeBaScene({.num_frames = 40, .num_points = 1200});
  const std::set<FrameId> window = Frames(34, 39);
  Reconstruction map = scene.truth;
  const Reconstruction off = PerturbedProblem(scene, 0.1, 0.5).start;
  for (const FrameId frame : window) {
    map.cam_from_world[frame] = off.cam_from_world.at(frame);
    map.center_in_world[frame] = off.center_in_world.at(frame);
  }
  const Reconstruction before = map;
  const BundleProblem problem = WindowProblem(map, scene.camera, window);
  // Tracks span ten frames: nothing older is in it.
  EXPECT_EQ(problem.start.cam_from_world.begin()->first, FrameId{25});
  EXPECT_EQ(problem.fixed_frames, Frames(25, 33));
  BundleOptions options;
  options.lens.refine_distortion = false;
  options.fine.function_tolerance = 1e-12;
  const BundleResult refined = RefineBundle(problem, options);
  ASSERT_TRUE(refined.Usable()) << refined.message;
  TakeWindow(problem, refined, map);
  for (const auto& [frame, center] : map.center_in_world) {
    if (!window.contains(frame)) {
      EXPECT_EQ(center, before.center_in_world.at(frame));
    }
    EXPECT_LT((center - scene.truth.center_in_world.at(frame)).norm(), 1e-5);
  }
  EXPECT_EQ(map.tracks.size(), map.point_in_world.size());
  EXPECT_GT(20 * map.tracks.size(), 19 * scene.truth.tracks.size());
}

TEST(WindowProblem, IsEmptyWithoutAPose) {
  const BaScene scene = MakeBaScene({});
  const BundleProblem problem = WindowProblem(scene.truth, scene.camera, Frames(100, 110));
  EXPECT_TRUE(problem.start.tracks.empty());
  EXPECT_EQ(RefineBundle(problem, {}).status, BundleStatus::kTooLittleData);
  Reconstruction map = scene.truth;
  TakeWindow(problem, RefineBundle(problem, {}), map);
  EXPECT_EQ(map.tracks.size(), scene.truth.tracks.size());
}

}  // namespace
}  // namespace rotslam
