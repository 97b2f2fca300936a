#include "rotodom/loop/waiting_edges.h"

#include <gtest/gtest.h>

namespace rotslam {
namespace {

Rotation Turned(double angle_deg) { return Rotation::Exp({0.0, angle_deg * kRadFromDeg, 0.0}); }

// Frames 0 to 3 are one piece, 10 to 13 another whose world is turned by 100 deg against the first
// one's; all look in directions 20 deg apart.
struct TwoPieces {
  RotationMap cam_from_world;
  RotationMap truth;
  DisjointSets pieces;

  TwoPieces() {
    for (const int first : {0, 10}) {
      for (int k = 0; k < 4; ++k) {
        const FrameId frame{first + k};
        truth[frame] = Turned(20.0 * k) * Rotation::Exp({0.1 * first, 0.0, 0.3});
        cam_from_world[frame] = first == 0 ? truth[frame] : truth[frame] * Turned(100.0);
        if (k > 0) pieces.Join(frame.value - 1, frame.value);
      }
    }
  }

  EdgeWithMatches Edge(int i, int j, double error_deg = 0.0, int num_inliers = 150) const {
    EdgeWithMatches connection;
    connection.edge.i = FrameId{i};
    connection.edge.j = FrameId{j};
    connection.edge.j_from_i =
        Turned(error_deg) * truth.at(FrameId{j}) * truth.at(FrameId{i}).Inverse();
    connection.edge.covariance = 1e-6 * num_inliers * Eigen::Matrix3d::Identity();
    connection.edge.num_inliers = num_inliers;
    return connection;
  }

  int NumConfirmed(const WaitingEdges& waiting, const EdgeWithMatches& connection) const {
    return static_cast<int>(waiting.Confirmed(connection, cam_from_world, pieces).size());
  }
};

WaitingEdges WaitingFor(const EdgeWithMatches& connection, VerificationOptions options = {}) {
  WaitingEdges waiting(options);
  waiting.Add(connection);
  return waiting;
}

TEST(WaitingEdges, TwoFramesThatSayTheSameProveEachOther) {
  const TwoPieces world;
  const WaitingEdges waiting = WaitingFor(world.Edge(1, 10, 0.3, 100));
  const auto confirmed =
      waiting.Confirmed(world.Edge(2, 12, -0.3), world.cam_from_world, world.pieces);
  ASSERT_EQ(confirmed.size(), 2U);
  EXPECT_EQ(confirmed.front().edge.j, FrameId{10});  // the more certain one
}

TEST(WaitingEdges, OneAloneWaits) {
  const TwoPieces world;
  EXPECT_EQ(world.NumConfirmed(WaitingEdges({}), world.Edge(2, 12)), 0);
}

TEST(WaitingEdges, ThoseThatDisagreeWait) {
  const TwoPieces world;
  EXPECT_EQ(world.NumConfirmed(WaitingFor(world.Edge(1, 10, 1.5)), world.Edge(2, 12)), 0);
}

TEST(WaitingEdges, FramesThatLookTheSameWayAreNoWitnesses) {
  TwoPieces world;
  world.truth[FrameId{11}] = world.truth[FrameId{10}];
  world.cam_from_world[FrameId{11}] = world.cam_from_world[FrameId{10}];
  EXPECT_EQ(world.NumConfirmed(WaitingFor(world.Edge(1, 10, 10.0)), world.Edge(1, 11, 10.0)), 0);
  EXPECT_EQ(world.NumConfirmed(WaitingFor(world.Edge(1, 10), {.min_witness_deg = 0.0}),
                               world.Edge(1, 11)),
            2);
}

TEST(WaitingEdges, FewMatchesProveNothing) {
  const TwoPieces world;
  EXPECT_EQ(world.NumConfirmed(WaitingFor(world.Edge(1, 10, 0.0, 49)), world.Edge(2, 12)), 0);
  EXPECT_EQ(world.NumConfirmed(WaitingFor(world.Edge(1, 10, 0.0, 50)), world.Edge(2, 12)), 2);
}

TEST(WaitingEdges, OtherPiecesAreNoWitnesses) {
  TwoPieces world;
  world.truth[FrameId{20}] = world.cam_from_world[FrameId{20}] = Turned(-50.0);
  EXPECT_EQ(world.NumConfirmed(WaitingFor(world.Edge(1, 20)), world.Edge(2, 12)), 0);
}

TEST(WaitingEdges, RemovedOnesWaitNoMore) {
  const TwoPieces world;
  WaitingEdges waiting = WaitingFor(world.Edge(1, 10));
  waiting.Remove({world.Edge(2, 10)});
  EXPECT_EQ(world.NumConfirmed(waiting, world.Edge(2, 12)), 2);
  waiting.Remove({world.Edge(1, 10)});
  EXPECT_EQ(world.NumConfirmed(waiting, world.Edge(2, 12)), 0);
}

}  // namespace
}  // namespace rotslam
