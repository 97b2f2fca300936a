#include "apps/paper_method/paper_graph.h"

#include <vector>

#include <gtest/gtest.h>

#include "tests/scenes/rotation_graph.h"

namespace rotslam {
namespace {

// Hands out the edges of a graph, with as many inliers as there are matches.
PairSolver SolverOf(const ViewGraph& graph) {
  return [&graph](const PairMatches& matches,
                  const Rotation&,
                  std::uint64_t) -> std::optional<RelativeRotation> {
    const RelativeRotation* edge = graph.FindEdge(matches.i, matches.j);
    if (edge == nullptr) return std::nullopt;
    RelativeRotation found = *edge;
    found.num_inliers = static_cast<int>(matches.pairs.size());
    return found;
  };
}

std::vector<PairMatches> MatchesOf(int frame, int reach, std::size_t count) {
  std::vector<PairMatches> matches;
  for (int i = frame - 1; i >= std::max(0, frame - reach); --i) {
    matches.push_back({FrameId{i}, FrameId{frame}, std::vector<BearingPair>(count)});
  }
  return matches;
}

RotationMap Follow(const RotationGraph& scene, AveragingMode mode) {
  PaperGraphOptions options;
  options.averaging.mode = mode;
  options.solver = SolverOf(scene.graph);
  PaperGraph graph(options);
  const int num_views = static_cast<int>(scene.true_cam_from_world.size());
  for (int k = 0; k < num_views; ++k) graph.AddFrame(FrameId{k}, MatchesOf(k, 4, 101));
  return graph.cam_from_world();
}

TEST(PaperGraph, ChainsWithoutAveragingAndIsBetterWith) {
  const RotationGraph scene = MakeRotationGraph({.num_views = 80});
  const RotationMap chained = Follow(scene, AveragingMode::kOff);
  for (const auto& [view, rotation] : chained) {
    EXPECT_LT((rotation * scene.chained_cam_from_world.at(view).Inverse()).AngleDeg(), 1e-9);
  }
  const RotationErrors off = CompareRotations(chained, scene.true_cam_from_world);
  const RotationErrors window =
      CompareRotations(Follow(scene, AveragingMode::kWindow), scene.true_cam_from_world);
  EXPECT_LT(window.step_rms_deg, 0.8 * off.step_rms_deg);
}

TEST(PaperGraph, AnEdgeHasMoreInliersThanTheta) {
  const RotationGraph scene = MakeRotationGraph({.num_views = 5});
  PaperGraphOptions options;
  options.solver = SolverOf(scene.graph);
  PaperGraph graph(options);
  graph.AddFrame(FrameId{0}, {});
  EXPECT_EQ(graph.AddFrame(FrameId{1}, MatchesOf(1, 4, 101)).edges.size(), 1U);
  const PaperGraph::Step step = graph.AddFrame(FrameId{2}, MatchesOf(2, 4, 100));
  EXPECT_TRUE(step.edges.empty());
  EXPECT_TRUE(step.predicted_only);
  // It goes on as before.
  const Rotation before = graph.cam_from_world().at(FrameId{1});
  EXPECT_LT((graph.cam_from_world().at(FrameId{2}) * (before * before).Inverse()).AngleDeg(), 1e-6);
}

// R_jk is looked for from R_j-1,k-1.
TEST(PaperGraph, StartsFromTheRotationBefore) {
  const RotationGraph scene = MakeRotationGraph({.num_views = 6});
  PaperGraphOptions options;
  std::vector<double> start_deg;
  options.averaging.mode = AveragingMode::kOff;
  options.solver = [&](const PairMatches& matches, const Rotation& start, std::uint64_t seed) {
    if (matches.j == FrameId{5}) {
      const Rotation& before =
          scene.graph.FindEdge(FrameId{matches.i.value - 1}, FrameId{4})->j_from_i;
      start_deg.push_back((start * before.Inverse()).AngleDeg());
    }
    return SolverOf(scene.graph)(matches, start, seed);
  };
  PaperGraph graph(options);
  for (int k = 0; k < 6; ++k) graph.AddFrame(FrameId{k}, MatchesOf(k, 4, 101));
  ASSERT_EQ(start_deg.size(), 4U);
  for (const double angle_deg : start_deg) EXPECT_LT(angle_deg, 1e-9);
}

TEST(PaperGraph, ALoopTakesTheDriftAway) {
  const RotationGraph scene = MakeRotationGraph({.num_views = 100, .noise_deg = 0.3});
  PaperGraphOptions options;
  options.solver = SolverOf(scene.graph);
  PaperGraph graph(options);
  for (int k = 0; k < 100; ++k) graph.AddFrame(FrameId{k}, MatchesOf(k, 4, 101));
  const double drift_deg =
      CompareRotations(graph.cam_from_world(), scene.true_cam_from_world).max_deg;
  RelativeRotation loop;
  loop.i = FrameId{0};
  loop.j = FrameId{99};
  loop.j_from_i = scene.true_cam_from_world.at(loop.j);
  loop.num_inliers = 200;
  graph.CloseLoops({});
  graph.CloseLoops(std::vector{loop});
  const RotationErrors errors = CompareRotations(graph.cam_from_world(), scene.true_cam_from_world);
  EXPECT_LT(errors.max_deg, drift_deg);
  EXPECT_LT((graph.cam_from_world().at(loop.j) * loop.j_from_i.Inverse()).AngleDeg(),
            0.5 * drift_deg);
}

}  // namespace
}  // namespace rotslam
