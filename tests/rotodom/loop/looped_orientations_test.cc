// Orientations and loops on view-graphs alone: edges to the four views before, with noise, from
// which a windowed odometry makes its estimates; loops are what the truth says.

#include "rotodom/loop/looped_orientations.h"

#include <algorithm>
#include <cstddef>
#include <limits>
#include <stdexcept>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "rotodom/averaging/averaging.h"
#include "tests/scenes/rotation_graph.h"

namespace rotslam {
namespace {

constexpr int kNumFrames = 120;
constexpr double kWeakErrorDeg = 5.0;

struct Loop {
  int after = 0;  // comes with this frame
  int i = 0;
  int j = 0;
};

struct Scene {
  std::vector<Loop> loops = {};
  std::vector<int> breaks = {};  // frames without edges to older ones
  std::vector<int> weak = {};    // frames with one edge, to the frame before, which is wrong
};

struct RunOptions {
  int handover_frames = 5;
  int num_threads = 2;
  double loop_variance = 1e-8;
};

const RotationGraph& Graph() {
  static const RotationGraph graph = MakeRotationGraph({.num_views = kNumFrames, .noise_deg = 0.2});
  return graph;
}

// The windowed odometry, orientations of all frames kept.
class Odometry {
 public:
  FrameEstimate Next(bool is_break, bool is_weak) {
    FrameEstimate estimate;
    estimate.frame = FrameId{next_++};
    const RotationGraph& scene = Graph();
    if (is_break) oldest_partner_ = estimate.frame;
    for (const int index : scene.graph.EdgesOf(estimate.frame)) {
      const RelativeRotation& edge = scene.graph.edges()[index];
      if (edge.j != estimate.frame || edge.i < oldest_partner_) continue;
      estimate.connections.push_back({edge, {}, {}});
      graph_.AddEdge(edge);
    }
    estimate.report.weak = is_weak;
    if (is_weak) {
      RelativeRotation edge =
          *scene.graph.FindEdge(FrameId{estimate.frame.value - 1}, estimate.frame);
      edge.j_from_i = Rotation::Exp({0.0, kWeakErrorDeg * kRadFromDeg, 0.0}) * edge.j_from_i;
      estimate.connections = {{edge, {}, {}}};
      graph_.AddEdge(edge);
    }
    // A break goes on as if the camera had stopped.
    Rotation cam_from_world = newest_;
    if (!estimate.connections.empty()) {
      const RelativeRotation& edge = estimate.connections.back().edge;
      cam_from_world = edge.j_from_i * cam_from_world_.at(edge.i);
    }
    cam_from_world_[estimate.frame] = cam_from_world;
    const AveragingOptions options;
    estimate.window = AverageRotations(
        graph_, cam_from_world_, ViewsToAverage(cam_from_world_, options), options);
    estimate.window.try_emplace(estimate.frame, cam_from_world);
    for (const auto& [frame, rotation] : estimate.window) cam_from_world_[frame] = rotation;
    newest_ = estimate.cam_from_world = cam_from_world_.at(estimate.frame);
    return estimate;
  }

 private:
  int next_ = 0;
  FrameId oldest_partner_{0};
  Rotation newest_;
  ViewGraph graph_;
  RotationMap cam_from_world_;
};

std::vector<EdgeWithMatches> LoopEdges(const Loop& loop, double variance) {
  RelativeRotation edge;
  edge.i = FrameId{loop.i};
  edge.j = FrameId{loop.j};
  const RotationMap& truth = Graph().true_cam_from_world;
  edge.j_from_i = truth.at(edge.j) * truth.at(edge.i).Inverse();
  edge.covariance = variance * Eigen::Matrix3d::Identity();
  edge.num_inliers = 500;
  return {EdgeWithMatches{edge, {}, {}}};
}

struct Course {
  std::vector<RotationMap> after_frame;
  std::vector<int> moved;  // frames with which orientations moved as loops say
  RotationMap finished;
};

Course Follow(const Scene& scene, const RunOptions& options = {}) {
  AveragingOptions averaging;
  averaging.min_step_deg = 1e-11;
  LoopOptions loops;
  loops.min_correction_deg = 0.4;  // twice the noise of an edge
  loops.handover_frames = options.handover_frames;
  LoopedOrientations orientations(averaging, loops, false, options.num_threads);
  Odometry odometry;
  Course run;
  run.after_frame.reserve(kNumFrames);
  for (int frame = 0; frame < kNumFrames; ++frame) {
    const bool is_break = std::count(scene.breaks.begin(), scene.breaks.end(), frame) > 0;
    const bool is_weak = std::count(scene.weak.begin(), scene.weak.end(), frame) > 0;
    FrameEstimate estimate = odometry.Next(is_break || is_weak, is_weak);
    orientations.BeginFrame(estimate);
    orientations.AddFrame(std::move(estimate));
    for (const Loop& loop : scene.loops) {
      if (loop.after != frame) continue;
      orientations.AddLoop(LoopEdges(loop, options.loop_variance));
    }
    if (orientations.EndFrame()) run.moved.push_back(frame);
    run.after_frame.push_back(orientations.result().cam_from_world);
  }
  orientations.Finish();
  run.finished = orientations.result().cam_from_world;
  return run;
}

double DifferenceDeg(const RotationMap& a, const RotationMap& b, int frame) {
  return (a.at(FrameId{frame}) * b.at(FrameId{frame}).Inverse()).AngleDeg();
}

double ErrorDeg(const RotationMap& estimate, int frame) {
  return DifferenceDeg(estimate, Graph().true_cam_from_world, frame);
}

// The turn from frame `from` to frame `to`, against that of another map.
double TurnDifferenceDeg(const RotationMap& a, const RotationMap& b, int from, int to) {
  const auto turn = [&](const RotationMap& map) {
    return map.at(FrameId{to}) * map.at(FrameId{from}).Inverse();
  };
  return (turn(a) * turn(b).Inverse()).AngleDeg();
}

void ExpectSameBytes(const RotationMap& a, const RotationMap& b) {
  ASSERT_EQ(a.size(), b.size());
  for (const auto& [frame, rotation] : a) {
    ASSERT_EQ(rotation.Quaternion().coeffs(), b.at(frame).Quaternion().coeffs()) << frame.value;
  }
}

const Scene kOneLoop = {.loops = {{80, 2, 79}}};

TEST(LoopedOrientations, TakeOverSoManyFramesLater) {
  const Course never = Follow({});
  ASSERT_GT(ErrorDeg(never.after_frame[80], 79), 0.5);
  for (const int delay : {0, 1, 5, 20}) {
    SCOPED_TRACE(delay);
    const Course run = Follow(kOneLoop, {.handover_frames = delay});
    EXPECT_EQ(run.moved, std::vector<int>{80 + delay});
    for (int frame = 0; frame < 80 + delay; ++frame) {
      ExpectSameBytes(run.after_frame[frame], never.after_frame[frame]);
    }
    EXPECT_LT(TurnDifferenceDeg(run.after_frame[80 + delay], Graph().true_cam_from_world, 2, 79),
              0.02);
  }
}

TEST(LoopedOrientations, TurnWhatCameSinceAsOne) {
  const Course never = Follow({});
  const Course run = Follow(kOneLoop, {.handover_frames = 20});
  const RotationMap& taken_over = run.after_frame[100];
  EXPECT_GT(DifferenceDeg(taken_over, never.after_frame[100], 100), 0.5);
  for (int frame = 81; frame <= 100; ++frame) {
    EXPECT_LT(TurnDifferenceDeg(taken_over, never.after_frame[100], 80, frame), 1e-9);
  }
  // And so do the next ones, which the odometry still moves among each other.
  for (int frame = 101; frame < kNumFrames; ++frame) {
    const RotationMap& then = run.after_frame[frame];
    EXPECT_LT(TurnDifferenceDeg(then, never.after_frame[frame], 100, frame), 1e-9);
    EXPECT_LT(DifferenceDeg(then, taken_over, 80), 1e-9);
  }
}

TEST(LoopedOrientations, AreTheSameOnAnyNumberOfThreads) {
  const Scene scene = {.loops = {{60, 2, 59}, {63, 5, 62}, {100, 10, 99}}};
  const Course one = Follow(scene, {.num_threads = 1});
  for (const int num_threads : {2, 4}) {
    const Course several = Follow(scene, {.num_threads = num_threads});
    EXPECT_EQ(several.moved, one.moved);
    for (int frame = 0; frame < kNumFrames; ++frame) {
      ExpectSameBytes(several.after_frame[frame], one.after_frame[frame]);
    }
    ExpectSameBytes(several.finished, one.finished);
  }
}

TEST(LoopedOrientations, EndTheSameWhateverTheDelay) {
  const Scene scene = {.loops = {{60, 2, 59}, {63, 5, 62}, {100, 10, 99}, {118, 20, 117}}};
  const Course at_once = Follow(scene, {.handover_frames = 0});
  for (const int delay : {1, 5, 1000}) {
    const Course late = Follow(scene, {.handover_frames = delay});
    for (int frame = 0; frame < kNumFrames; ++frame) {
      EXPECT_LT(DifferenceDeg(late.finished, at_once.finished, frame), 1e-9 * kDegFromRad) << frame;
    }
  }
}

TEST(LoopedOrientations, AverageAgainForALoopThatCameMeanwhile) {
  // The first loop puts frame 78 right, but not 60 against 30.
  const Course again = Follow({.loops = {{80, 2, 79}, {83, 2, 78}, {84, 30, 60}}});
  EXPECT_EQ(again.moved, (std::vector<int>{85, 90}));
  EXPECT_LT(TurnDifferenceDeg(again.after_frame[90], Graph().true_cam_from_world, 30, 60), 0.02);
  const Course enough = Follow({.loops = {{80, 2, 79}, {83, 2, 78}}});
  EXPECT_EQ(enough.moved, std::vector<int>{85});
}

// Three pieces, 0-49, 50-69 and from 70 on.
const std::vector<int> kBreaks = {50, 70};

TEST(LoopedOrientations, TurnThePieceThatBeganLater) {
  const Course run = Follow({.loops = {{80, 40, 79}}, .breaks = kBreaks}, {.handover_frames = 20});
  EXPECT_EQ(run.moved, (std::vector<int>{80, 100}));
  const RotationMap& before = run.after_frame[79];
  const RotationMap& after = run.after_frame[80];
  EXPECT_GT(TurnDifferenceDeg(before, Graph().true_cam_from_world, 40, 79), 3.0);
  EXPECT_LT(TurnDifferenceDeg(after, Graph().true_cam_from_world, 40, 79), 1e-9);
  // Not the window, either, which reaches back to frame 70.
  for (int frame = 0; frame < 70; ++frame) EXPECT_EQ(DifferenceDeg(after, before, frame), 0.0);
  for (int frame = 80; frame < kNumFrames; ++frame) {
    EXPECT_LT(TurnDifferenceDeg(run.after_frame[frame], Graph().true_cam_from_world, 40, frame),
              1.5);
  }
}

TEST(LoopedOrientations, TurnTheLaterPieceWhenTheLoopEndsInTheOlderOne) {
  const Scene scene = {.loops = {{80, 40, 79}, {110, 60, 109}}, .breaks = kBreaks};
  const Course run = Follow(scene, {.handover_frames = 5});
  const RotationMap& before = run.after_frame[109];
  const RotationMap& after = run.after_frame[110];
  EXPECT_GT(TurnDifferenceDeg(before, Graph().true_cam_from_world, 60, 109), 3.0);
  EXPECT_LT(TurnDifferenceDeg(after, Graph().true_cam_from_world, 60, 109), 1e-9);
  for (int frame = 0; frame < 110; ++frame) {
    if (frame >= 50 && frame < 70) continue;
    // The odometry moves its window.
    EXPECT_LT(DifferenceDeg(after, before, frame), frame < 100 ? 1e-12 : 0.2) << frame;
  }
  for (int frame = 110; frame < kNumFrames; ++frame) {
    EXPECT_LT(TurnDifferenceDeg(run.after_frame[frame], Graph().true_cam_from_world, 40, frame),
              1.5);
  }
}

TEST(LoopedOrientations, TurnNoPieceUnderAnAveraging) {
  // What begins with frame 80 does not know of the piece that is turned with frame 85.
  const Scene scene = {.loops = {{80, 40, 79}, {85, 60, 84}}, .breaks = kBreaks};
  const Course run = Follow(scene, {.handover_frames = 10});
  EXPECT_EQ(run.moved, (std::vector<int>{80, 85, 95}));
  const RotationMap& truth = Graph().true_cam_from_world;
  for (int frame = 85; frame < kNumFrames; ++frame) {
    EXPECT_LT(TurnDifferenceDeg(run.after_frame[frame], truth, 60, 84), 0.01) << frame;
    EXPECT_LT(TurnDifferenceDeg(run.after_frame[frame], truth, 40, 79), 0.01) << frame;
  }
}

TEST(LoopedOrientations, BelieveNoWeakEdgeWhereThereIsABetterWay) {
  const Course run = Follow({.loops = {{80, 40, 79}}, .weak = {70}});
  const RotationMap& truth = Graph().true_cam_from_world;
  EXPECT_GT(TurnDifferenceDeg(run.after_frame[79], truth, 40, 70), 0.8 * kWeakErrorDeg);
  EXPECT_EQ(run.moved, (std::vector<int>{80, 85}));
  EXPECT_LT(TurnDifferenceDeg(run.after_frame[85], truth, 40, 70), 0.5);
  EXPECT_LT(TurnDifferenceDeg(run.finished, truth, 40, 70), 0.5);
}

TEST(LoopedOrientations, PassOnWhatTheAveragingThrows) {
  for (const int num_threads : {1, 2}) {
    const RunOptions options = {.num_threads = num_threads,
                                .loop_variance = std::numeric_limits<double>::quiet_NaN()};
    EXPECT_THROW(Follow(kOneLoop, options), std::invalid_argument);
    EXPECT_NO_THROW(Follow({}, options));
  }
}

}  // namespace
}  // namespace rotslam
