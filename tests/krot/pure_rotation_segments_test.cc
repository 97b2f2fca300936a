#include "krot/pure_rotation_segments.h"

#include <algorithm>
#include <stdexcept>

#include <gtest/gtest.h>

namespace rotslam {
namespace {

struct Path {
  ViewGraph graph;
  RotationMap cam_from_world;
};

// Frames first_frame, first_frame + stride, ...; `place[k]` says where the k-th stands. An edge
// shows a baseline when its ends stand further apart than `visible`.
Path MakePath(const std::vector<double>& place,
              int reach = 4,
              double visible = 0.5,
              int first_frame = 0,
              int stride = 1) {
  Path path;
  const auto frame = [&](int k) { return FrameId{first_frame + stride * k}; };
  for (int k = 0; k < static_cast<int>(place.size()); ++k) {
    path.cam_from_world[frame(k)] = Rotation::Exp({0.0, 0.02 * k, 0.0});
    for (int before = std::max(0, k - reach); before < k; ++before) {
      RelativeRotation edge{
          frame(before), frame(k), Rotation::Exp({0.0, 0.02 * (k - before), 0.0})};
      edge.rotation_only = std::abs(place[k] - place[before]) <= visible;
      path.graph.AddEdge(edge);
    }
  }
  return path;
}

// Walks `before` steps, stands for `standing` more, walks `after` steps.
std::vector<double> WalkStopWalk(int before, int standing, int after, double step = 1.0) {
  std::vector<double> place = {0.0};
  for (int k = 0; k < before; ++k) place.push_back(place.back() + step);
  for (int k = 0; k < standing; ++k) place.push_back(place.back());
  for (int k = 0; k < after; ++k) place.push_back(place.back() + step);
  return place;
}

std::vector<PureRotationSegment> Find(const Path& path, const PureRotationOptions& options = {}) {
  return FindPureRotationSegments(path.graph, path.cam_from_world, options);
}

// Whatever the edges say of a baseline: the first ten frames rest, the others rotate.
TEST(AllFramesAsSegment, SaysWhereTheCameraRests) {
  Path path = MakePath(WalkStopWalk(20, 0, 0));
  ViewGraph graph;
  for (RelativeRotation edge : path.graph.edges()) {
    if (edge.j <= FrameId{9}) edge.j_from_i = Rotation();
    edge.covariance = 1e-8 * Eigen::Matrix3d::Identity();
    graph.AddEdge(edge);
  }
  const PureRotationSegment all = AllFramesAsSegment(graph, path.cam_from_world, {});
  EXPECT_EQ(all.first, FrameId{0});
  EXPECT_EQ(all.last, FrameId{20});
  EXPECT_EQ(all.evidence, 0.0);
  ASSERT_EQ(all.still.size(), 1u);
  EXPECT_EQ(all.still[0].first, FrameId{0});
  EXPECT_NEAR(all.still[0].last.value, 9, 2);
}

TEST(FindPureRotationSegments, FindsTheTurnInPlace) {
  const auto stretches = Find(MakePath(WalkStopWalk(10, 15, 10)));
  ASSERT_EQ(stretches.size(), 1u);
  // The edges that reach over an end of the turn show a baseline, so it may lose a reach at most.
  EXPECT_GE(stretches[0].first, FrameId{10});
  EXPECT_LE(stretches[0].first, FrameId{13});
  EXPECT_LE(stretches[0].last, FrameId{25});
  EXPECT_GE(stretches[0].last, FrameId{22});
  EXPECT_GE(stretches[0].evidence, 0.5);
  EXPECT_LE(stretches[0].evidence, 1.0);
}

TEST(FindPureRotationSegments, NeverHoldsAStepOfAWalk) {
  for (const int standing : {0, 8, 12, 20}) {
    for (const PureRotationSegment& stretch : Find(MakePath(WalkStopWalk(10, standing, 10)))) {
      EXPECT_GE(stretch.first, FrameId{10}) << standing;
      EXPECT_LE(stretch.last, FrameId{10 + standing}) << standing;
    }
  }
}

TEST(FindPureRotationSegments, TheWholeSequenceMayBeHeld) {
  const auto stretches = Find(MakePath(std::vector<double>(20, 3.0)));
  ASSERT_EQ(stretches.size(), 1u);
  EXPECT_EQ(stretches[0].first, FrameId{0});
  EXPECT_EQ(stretches[0].last, FrameId{19});
  EXPECT_EQ(stretches[0].evidence, 1.0);
}

TEST(FindPureRotationSegments, ASlowCameraShowsInTheLongestEdges) {
  // Neighbours stand too near to one another for a baseline to show, the ends of the longest edges
  // do not.
  EXPECT_TRUE(Find(MakePath(WalkStopWalk(30, 0, 0, 0.2))).empty());
}

TEST(FindPureRotationSegments, IgnoresShortRuns) {
  PureRotationOptions options;
  const Path path = MakePath(std::vector<double>(8, 0.0));
  EXPECT_EQ(Find(path, options).size(), 1u);  // eight frames, seven steps
  options.min_frames = 9;
  EXPECT_TRUE(Find(path, options).empty());
}

TEST(FindPureRotationSegments, TwoStopsAreTwoStretches) {
  std::vector<double> place = WalkStopWalk(5, 20, 10);
  for (const double more : WalkStopWalk(0, 20, 5)) place.push_back(place[35] + more);
  const auto stretches = Find(MakePath(place));
  ASSERT_EQ(stretches.size(), 2u);
  EXPECT_LT(stretches[0].last, stretches[1].first);
}

TEST(FindPureRotationSegments, SwitchedOffFindsNone) {
  PureRotationOptions options;
  options.enabled = false;
  EXPECT_TRUE(Find(MakePath(std::vector<double>(20, 3.0)), options).empty());
}

TEST(FindPureRotationSegments, EvidenceIsTheMeanShareOfTheLongestEdges) {
  // Ten frames in place with edges of span two; two of the eight contradict.
  Path path = MakePath(std::vector<double>(10, 0.0), 2);
  for (const int first : {3, 6}) {
    RelativeRotation edge = *path.graph.FindEdge(FrameId{first}, FrameId{first + 2});
    edge.rotation_only = false;
    path.graph.AddEdge(edge);
  }
  const auto stretches = Find(path);
  ASSERT_EQ(stretches.size(), 1u);
  EXPECT_EQ(stretches[0].first, FrameId{0});
  EXPECT_EQ(stretches[0].last, FrameId{9});
  // Each of the two lies across two steps and makes one half of each: 5 of 9 steps are certain.
  EXPECT_NEAR(stretches[0].evidence, (5.0 + 4 * 0.5) / 9.0, 1e-12);
  PureRotationOptions strict;
  strict.min_rotation_only_ratio = 0.9;
  strict.min_frames = 2;
  for (const PureRotationSegment& stretch : Find(path, strict)) EXPECT_EQ(stretch.evidence, 1.0);
}

TEST(FindPureRotationSegments, AStepWithoutEdgesIsNotHeld) {
  Path path = MakePath(std::vector<double>(30, 0.0));
  ViewGraph cut;
  for (const RelativeRotation& edge : path.graph.edges()) {
    if ((edge.i.value < 15) == (edge.j.value < 15)) cut.AddEdge(edge);
  }
  path.graph = cut;
  const auto stretches = Find(path);
  ASSERT_EQ(stretches.size(), 2u);
  EXPECT_EQ(stretches[0].last, FrameId{14});
  EXPECT_EQ(stretches[1].first, FrameId{15});
}

// A keyframe before the turn, followed all through it, shows the way to it and not the camera's
// rest.
TEST(FindPureRotationSegments, EdgesToOldKeyframesDoNotHideATurn) {
  Path path = MakePath(WalkStopWalk(10, 15, 10));
  const auto without = Find(path);
  for (int k = 12; k < 34; ++k) {
    path.graph.AddEdge({FrameId{2}, FrameId{k}, Rotation::Exp({0.0, 0.02 * (k - 2), 0.0})});
  }
  const auto with = Find(path);
  ASSERT_EQ(without.size(), 1u);
  ASSERT_EQ(with.size(), 1u);
  EXPECT_EQ(with[0].first, without[0].first);
  EXPECT_EQ(with[0].last, without[0].last);
  PureRotationOptions all;
  all.max_edge_span = 100;
  EXPECT_TRUE(Find(path, all).empty());
}

// Where frames are missing, only long edges lead across.
TEST(FindPureRotationSegments, LongEdgesCountWhereThereAreNoOthers) {
  const Path path = MakePath(WalkStopWalk(10, 30, 10), 12);
  Path cut = path;
  cut.graph = ViewGraph();
  const auto is_dark = [](FrameId frame) { return frame.value >= 20 && frame.value < 26; };
  for (const RelativeRotation& edge : path.graph.edges()) {
    if (!is_dark(edge.i) && !is_dark(edge.j)) cut.graph.AddEdge(edge);
  }
  const auto stretches = Find(cut);
  ASSERT_EQ(stretches.size(), 1u);
  EXPECT_LE(stretches[0].first, FrameId{13});
  EXPECT_GE(stretches[0].last, FrameId{37});
}

// Something moves through the picture, or one frame is blurred.
TEST(FindPureRotationSegments, DirectEdgesBridgeABadFrame) {
  Path path = MakePath(std::vector<double>(30, 0.0));
  const auto disturb = [&](int frame) {
    for (int before = frame - 4; before <= frame + 4; ++before) {
      if (before == frame) continue;
      RelativeRotation edge = *path.graph.FindEdge(FrameId{before}, FrameId{frame});
      edge.rotation_only = false;
      path.graph.AddEdge(edge);
    }
  };
  for (const int frame : {14, 15, 16}) disturb(frame);
  EXPECT_EQ(Find(path).size(), 2u);
  for (int k = 20; k < 30; ++k) {
    RelativeRotation edge{FrameId{5}, FrameId{k}, Rotation::Exp({0.0, 0.02 * (k - 5), 0.0})};
    edge.rotation_only = true;
    path.graph.AddEdge(edge);
  }
  const auto stretches = Find(path);
  ASSERT_EQ(stretches.size(), 1u);
  EXPECT_EQ(stretches[0].first, FrameId{0});
  EXPECT_EQ(stretches[0].last, FrameId{29});
  PureRotationOptions options;
  options.max_gap = 0;
  EXPECT_EQ(Find(path, options).size(), 2u);
}

// Neighbours stand too near for a baseline to show, and so do the ends of short edges; an edge to a
// frame long ago does not.
TEST(FindPureRotationSegments, LongEdgesInsideTellACreepingCamera) {
  Path path = MakePath(WalkStopWalk(40, 0, 0, 0.05));
  EXPECT_EQ(Find(path).size(), 1u);
  for (int k = 12; k <= 40; ++k) {
    path.graph.AddEdge({FrameId{k - 12}, FrameId{k}, Rotation::Exp({0.0, 0.24, 0.0})});
  }
  EXPECT_TRUE(Find(path).empty());
}

TEST(FindPureRotationSegments, TellsStandingStillFromTurning) {
  Path path = MakePath(std::vector<double>(40, 0.0));
  const double sigma = 1e-5;
  ViewGraph graph;
  for (RelativeRotation edge : path.graph.edges()) {
    edge.covariance = sigma * sigma * Eigen::Matrix3d::Identity();
    // At rest for the first half, but for errors as large as those of real images.
    const double error = 4.0 * sigma;
    const double turn = 0.02 * std::max(0, edge.j.value - std::max(20, edge.i.value));
    edge.j_from_i = Rotation::Exp({error, turn - error, error});
    graph.AddEdge(edge);
  }
  path.graph = graph;
  const auto stretches = Find(path);
  ASSERT_EQ(stretches.size(), 1u);
  EXPECT_EQ(stretches[0].last, FrameId{39});
  ASSERT_EQ(stretches[0].still.size(), 1u);
  EXPECT_EQ(stretches[0].still[0].first, FrameId{0});
  EXPECT_GE(stretches[0].still[0].last, FrameId{19});
  EXPECT_LE(stretches[0].still[0].last, FrameId{22});
  PureRotationOptions sharp;
  sharp.still_sigmas = 0.1;
  EXPECT_TRUE(Find(path, sharp)[0].still.empty());
}

TEST(FindPureRotationSegments, FrameNumbersMayHaveGaps) {
  const auto dense = Find(MakePath(WalkStopWalk(10, 15, 10)));
  const auto sparse = Find(MakePath(WalkStopWalk(10, 15, 10), 4, 0.5, 100, 5));
  ASSERT_EQ(dense.size(), 1u);
  ASSERT_EQ(sparse.size(), 1u);
  EXPECT_EQ(sparse[0].first.value, 100 + 5 * dense[0].first.value);
  EXPECT_EQ(sparse[0].last.value, 100 + 5 * dense[0].last.value);
  EXPECT_EQ(sparse[0].evidence, dense[0].evidence);
}

TEST(FindPureRotationSegments, NothingGivesNothing) {
  EXPECT_TRUE(FindPureRotationSegments({}, {}, {}).empty());
  EXPECT_TRUE(FindPureRotationSegments({}, {{FrameId{0}, Rotation()}}, {}).empty());
}

TEST(FindPureRotationSegments, RejectsAnEdgeToAFrameWithoutOrientation) {
  ViewGraph graph;
  RelativeRotation edge;
  edge.i = FrameId{0};
  edge.j = FrameId{7};
  graph.AddEdge(edge);
  EXPECT_THROW(FindPureRotationSegments(graph, {{FrameId{0}, Rotation()}}, {}),
               std::invalid_argument);
}

TEST(PureRotationOptions, NamesTheFirstFieldOutOfRange) {
  EXPECT_FALSE(PureRotationOptions{}.Problem());
  PureRotationOptions options;
  options.still_sigmas = 0.0;
  EXPECT_EQ(options.Problem(), "still_sigmas is 0, must be positive");
  options.min_frames = 1;
  EXPECT_EQ(options.Problem(), "min_frames is 1, must be at least 2");
  options.max_edge_span = 0;
  EXPECT_EQ(options.Problem(), "max_edge_span is 0, must be at least 1");
  options.min_rotation_only_ratio = 0.0;
  EXPECT_TRUE(options.Problem().value_or("none").starts_with("min_rotation_only_ratio is 0"));
  EXPECT_THROW(FindPureRotationSegments({}, {}, options), std::invalid_argument);
}

}  // namespace
}  // namespace rotslam
