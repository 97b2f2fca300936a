#include "rotodom/self_calibration/through_lens.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "rotodom/view_graph/estimate_edges.h"
#include "tests/rotodom/self_calibration/filmed_room.h"

namespace rotslam {
namespace {

// What an odometry finds that looks through `camera`.
OdometryResult TrackThrough(const Camera& camera, const FilmedRoom& room) {
  constexpr int kReach = 4;
  OdometryResult result;
  result.features = room.features;
  for (auto& [frame, features] : result.features) {
    for (int k = 0; k < features.size(); ++k) {
      features.bearings[k] = camera.Unproject(features.keypoints_px[k]).value();
    }
  }
  result.cam_from_world = room.cam_from_world;
  for (const auto& [frame, features] : result.features) {
    for (int i = std::max(0, frame.value - kReach); i < frame.value; ++i) {
      const auto edges = EstimateEdges(
          features, {&result.features.at(FrameId{i})}, room.cam_from_world, camera.MeanFocal(), {});
      if (edges.empty()) continue;
      result.graph.AddEdge(edges.front().edge);
      result.edge_matches.push_back(edges.front().matches);
    }
  }
  return result;
}

double LargestErrorDeg(const RotationMap& rotations, const RotationMap& truth) {
  double largest = 0.0;
  for (const auto& [frame, rotation] : rotations) {
    const Rotation found = rotation * rotations.begin()->second.Inverse();
    const Rotation turn = truth.at(frame) * truth.begin()->second.Inverse();
    largest = std::max(largest, (found * turn.Inverse()).AngleDeg());
  }
  return largest;
}

TEST(ThroughLens, GivesTheOrientationsOfTheRightLens) {
  const Camera truth = LensOfModel(CameraModel::kPinhole, 500.0);
  Camera wrong = truth;
  wrong.fx = wrong.fy = 600.0;
  const FilmedRoom room = FilmRoom(truth, 0.06, 0.1, 0.0);
  const OdometryResult tracked = TrackThrough(wrong, room);
  const OdometryResult through_wrong = ThroughLens(tracked, wrong, {}, 1, 1);
  EXPECT_GT(LargestErrorDeg(through_wrong.cam_from_world, room.cam_from_world), 3.0);
  const OdometryResult through_right = ThroughLens(tracked, truth, {}, 1, 2);
  EXPECT_LT(LargestErrorDeg(through_right.cam_from_world, room.cam_from_world), 0.2);
  EXPECT_EQ(through_right.graph.edges().size(), through_right.edge_matches.size());
  EXPECT_GE(through_right.graph.edges().size(), tracked.graph.edges().size());
  EXPECT_EQ(through_right.features.size(), room.features.size());
}

TEST(TurnedThroughLens, IsExactForATurnInPlace) {
  const Camera wrong = LensOfModel(CameraModel::kPinhole, 500.0);
  Camera right = LensOfModel(CameraModel::kRadtan, 470.0);
  right.cx += 15.0;
  right.cy -= 10.0;
  right.distortion = {-0.1, 0.02};
  const Rotation turn = Rotation::Exp({0.02, -0.1, 0.05});
  // What a turn through the right lens looks like through the wrong one.
  RelativeRotation edge;
  edge.i = FrameId{0};
  edge.j = FrameId{1};
  edge.j_from_i = turn;
  ViewGraph graph;
  graph.AddEdge(edge);
  const ViewGraph seen = TurnedThroughLens(graph, right, wrong);
  const Rotation taken = seen.edges().front().j_from_i;
  EXPECT_GT((taken * turn.Inverse()).AngleDeg(), 0.1);
  const Rotation again = TurnedThroughLens(seen, wrong, right).edges().front().j_from_i;
  EXPECT_LT((again * turn.Inverse()).AngleDeg(), 0.1 * (taken * turn.Inverse()).AngleDeg());
  EXPECT_LT(
      (TurnedThroughLens(graph, right, right).edges().front().j_from_i * turn.Inverse()).AngleDeg(),
      1e-9);
}

TEST(TurnedThroughLens, KnowsLessOfEdgesWithParallax) {
  const Camera from = LensOfModel(CameraModel::kPinhole, 500.0);
  const Camera to = LensOfModel(CameraModel::kPinhole, 480.0);
  ViewGraph graph;
  for (int k = 1; k <= 2; ++k) {
    RelativeRotation edge;
    edge.i = FrameId{0};
    edge.j = FrameId{k};
    edge.covariance = 1e-8 * Eigen::Matrix3d::Identity();
    edge.parallax_px = k == 1 ? 0.0 : 20.0;
    graph.AddEdge(edge);
  }
  const ViewGraph turned = TurnedThroughLens(graph, from, to);
  EXPECT_EQ(turned.FindEdge(FrameId{0}, FrameId{1})->covariance(0, 0), 1e-8);
  EXPECT_GT(turned.FindEdge(FrameId{0}, FrameId{2})->covariance(0, 0), 1e-7);
  const ViewGraph same = TurnedThroughLens(graph, from, from);
  EXPECT_EQ(same.FindEdge(FrameId{0}, FrameId{2})->covariance(0, 0), 1e-8);
}

TEST(ThroughLens, DoesNotDependOnThreads) {
  const Camera camera = LensOfModel(CameraModel::kPinhole, 500.0);
  const FilmedRoom room = FilmRoom(camera, 0.06, 0.3, 0.0, 12);
  const OdometryResult tracked = TrackThrough(camera, room);
  const OdometryResult one = ThroughLens(tracked, camera, {}, 1, 1);
  const OdometryResult two = ThroughLens(tracked, camera, {}, 1, 2);
  ASSERT_EQ(one.cam_from_world.size(), two.cam_from_world.size());
  for (const auto& [frame, rotation] : one.cam_from_world) {
    EXPECT_EQ(rotation.Matrix(), two.cam_from_world.at(frame).Matrix());
  }
}

}  // namespace
}  // namespace rotslam
