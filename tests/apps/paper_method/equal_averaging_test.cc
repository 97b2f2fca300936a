#include "apps/paper_method/equal_averaging.h"

#include <iterator>
#include <set>

#include <gtest/gtest.h>

#include "tests/scenes/rotation_graph.h"

namespace rotslam {
namespace {

std::set<FrameId> AllButTheFirst(const RotationMap& rotations) {
  std::set<FrameId> views;
  for (auto entry = std::next(rotations.begin()); entry != rotations.end(); ++entry) {
    views.insert(entry->first);
  }
  return views;
}

RotationMap With(RotationMap rotations, const RotationMap& changed) {
  for (const auto& [view, rotation] : changed) rotations[view] = rotation;
  return rotations;
}

TEST(AverageEqually, IsExactWithExactEdges) {
  const RotationGraph scene = MakeRotationGraph({.num_views = 12, .noise_deg = 0.0});
  RotationMap start = scene.true_cam_from_world;
  for (const FrameId view : AllButTheFirst(start)) {
    start[view] = Rotation::Exp({0.02, -0.01, 0.01 * (view.value % 3)}) * start[view];
  }
  const RotationMap averaged = AverageEqually(scene.graph, start, AllButTheFirst(start));
  EXPECT_LT(CompareRotations(With(start, averaged), scene.true_cam_from_world).max_deg, 1e-3);
}

TEST(AverageEqually, HoldsWhatIsNotFree) {
  const RotationGraph scene = MakeRotationGraph({.num_views = 30});
  const std::set<FrameId> free_views = {FrameId{27}, FrameId{28}, FrameId{29}};
  const RotationMap averaged = AverageEqually(scene.graph, scene.true_cam_from_world, free_views);
  EXPECT_EQ(averaged.size(), 3U);
  for (const auto& [view, rotation] : averaged) {
    EXPECT_TRUE(free_views.contains(view));
    EXPECT_LT((rotation * scene.true_cam_from_world.at(view).Inverse()).AngleDeg(), 0.2);
  }
}

RotationErrors ErrorsOf(const RotationGraph& scene) {
  const RotationMap& start = scene.chained_cam_from_world;
  const RotationMap averaged = AverageEqually(scene.graph, start, AllButTheFirst(start));
  return CompareRotations(With(start, averaged), scene.true_cam_from_world);
}

TEST(AverageEqually, IsBetterThanChaining) {
  const RotationGraph scene = MakeRotationGraph({.num_views = 60});
  const RotationErrors chained =
      CompareRotations(scene.chained_cam_from_world, scene.true_cam_from_world);
  EXPECT_LT(ErrorsOf(scene).step_rms_deg, 0.8 * chained.step_rms_deg);
}

// Of wrong edges, up to 60 deg off, those that the loss takes for right ones remain: below 5 deg.
TEST(AverageEqually, ResistsWrongEdges) {
  const RotationGraph scene = MakeRotationGraph({.num_views = 60, .wrong_ratio = 0.05});
  EXPECT_LT(ErrorsOf(scene).step_rms_deg, 0.3);
}

// An edge counts alike whatever its covariance says: that is what equal weights are.
TEST(AverageEqually, KnowsNoCovariances) {
  const RotationGraph scene = MakeRotationGraph({.num_views = 20});
  ViewGraph changed;
  for (RelativeRotation edge : scene.graph.edges()) {
    edge.covariance *= 1.0 + edge.i.value % 5;
    changed.AddEdge(edge);
  }
  const RotationMap& start = scene.chained_cam_from_world;
  const RotationMap a = AverageEqually(scene.graph, start, AllButTheFirst(start));
  const RotationMap b = AverageEqually(changed, start, AllButTheFirst(start));
  for (const auto& [view, rotation] : a) {
    EXPECT_EQ(rotation.Quaternion().coeffs(), b.at(view).Quaternion().coeffs());
  }
}

TEST(AverageEqually, LeavesAViewWithoutEdgesAlone) {
  const RotationMap start = {{FrameId{0}, Rotation()}, {FrameId{1}, Rotation::Exp({0.1, 0, 0})}};
  const RotationMap averaged = AverageEqually(ViewGraph(), start, {FrameId{1}});
  EXPECT_EQ(averaged.at(FrameId{1}).Quaternion().coeffs(),
            start.at(FrameId{1}).Quaternion().coeffs());
}

}  // namespace
}  // namespace rotslam
