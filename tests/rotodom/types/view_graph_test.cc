#include "rotodom/types/view_graph.h"

#include <stdexcept>

#include <gtest/gtest.h>

namespace rotslam {
namespace {

RelativeRotation MakeEdge(int i, int j) {
  RelativeRotation edge;
  edge.i = FrameId{i};
  edge.j = FrameId{j};
  edge.j_from_i = Rotation::Exp({0.1 * i, 0.2, -0.1 * j});
  edge.covariance = Eigen::Vector3d(1.0, 2.0, 3.0).asDiagonal();
  edge.translation_direction = Eigen::Vector3d(1.0, 2.0, 2.0) / 3.0;
  return edge;
}

TEST(ViewGraph, KeepsSmallerIdFirstAndFlipsTheRotation) {
  ViewGraph graph;
  const RelativeRotation edge = MakeEdge(5, 2);
  graph.AddEdge(edge);
  const RelativeRotation* stored = graph.FindEdge(FrameId{5}, FrameId{2});
  ASSERT_NE(stored, nullptr);
  EXPECT_EQ(stored->i, FrameId{2});
  EXPECT_LT((stored->j_from_i * edge.j_from_i).Angle(), 1e-14);
}

TEST(ViewGraph, FlippingTwiceChangesNothing) {
  const RelativeRotation edge = MakeEdge(1, 2);
  const RelativeRotation twice = Flipped(Flipped(edge));
  EXPECT_LT((twice.j_from_i.Inverse() * edge.j_from_i).Angle(), 1e-14);
  EXPECT_LT((twice.covariance - edge.covariance).norm(), 1e-14);
  EXPECT_LT((twice.translation_direction - edge.translation_direction).norm(), 1e-14);
}

TEST(ViewGraph, FlippedCovarianceIsThatOfTheInverse) {
  const RelativeRotation edge = MakeEdge(1, 2);
  const Eigen::Vector3d delta(1e-6, -2e-6, 3e-6);
  const Rotation disturbed = Rotation::Exp(delta) * edge.j_from_i;
  const RelativeRotation flipped = Flipped(edge);
  const Eigen::Vector3d seen = (disturbed.Inverse() * flipped.j_from_i.Inverse()).Log();
  // The same Mahalanobis distance, whichever way the edge is read.
  EXPECT_NEAR(
      seen.dot(flipped.covariance.inverse() * seen) / delta.dot(edge.covariance.inverse() * delta),
      1.0,
      1e-5);
}

TEST(ViewGraph, ReplacesAnEdgeOfTheSamePair) {
  ViewGraph graph;
  graph.AddEdge(MakeEdge(0, 1));
  RelativeRotation better = MakeEdge(1, 0);
  better.num_inliers = 7;
  graph.AddEdge(better);
  graph.AddEdge(MakeEdge(1, 2));
  EXPECT_EQ(graph.edges().size(), 2u);
  EXPECT_EQ(graph.FindEdge(FrameId{0}, FrameId{1})->num_inliers, 7);
  EXPECT_EQ(graph.EdgesOf(FrameId{1}).size(), 2u);
  EXPECT_TRUE(graph.EdgesOf(FrameId{9}).empty());
}

TEST(ViewGraph, RejectsLoopsAndUnsetIds) {
  ViewGraph graph;
  EXPECT_THROW(graph.AddEdge(MakeEdge(3, 3)), std::invalid_argument);
  EXPECT_THROW(graph.AddEdge(MakeEdge(-1, 3)), std::invalid_argument);
}

}  // namespace
}  // namespace rotslam
