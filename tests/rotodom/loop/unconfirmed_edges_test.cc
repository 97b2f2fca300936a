#include "rotodom/loop/unconfirmed_edges.h"

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

  int NumConfirmed(const UnconfirmedEdges& unconfirmed, const EdgeWithMatches& connection) const {
    return static_cast<int>(unconfirmed.Confirmed(connection, cam_from_world, pieces).size());
  }
};

UnconfirmedEdges UnconfirmedWith(const EdgeWithMatches& connection,
                                 VerificationOptions options = {}) {
  UnconfirmedEdges unconfirmed(options);
  unconfirmed.Add(connection);
  return unconfirmed;
}

TEST(UnconfirmedEdges, TwoFramesThatSayTheSameProveEachOther) {
  const TwoPieces world;
  const UnconfirmedEdges unconfirmed = UnconfirmedWith(world.Edge(1, 10, 0.3, 100));
  const auto confirmed =
      unconfirmed.Confirmed(world.Edge(2, 12, -0.3), world.cam_from_world, world.pieces);
  ASSERT_EQ(confirmed.size(), 2U);
  EXPECT_EQ(confirmed.front().edge.j, FrameId{10});  // the more certain one
}

TEST(UnconfirmedEdges, OneAloneStaysUnconfirmed) {
  const TwoPieces world;
  EXPECT_EQ(world.NumConfirmed(UnconfirmedEdges({}), world.Edge(2, 12)), 0);
}

TEST(UnconfirmedEdges, ThoseThatDisagreeStayUnconfirmed) {
  const TwoPieces world;
  EXPECT_EQ(world.NumConfirmed(UnconfirmedWith(world.Edge(1, 10, 1.5)), world.Edge(2, 12)), 0);
}

TEST(UnconfirmedEdges, FramesThatLookTheSameWayAreNoWitnesses) {
  TwoPieces world;
  world.truth[FrameId{11}] = world.truth[FrameId{10}];
  world.cam_from_world[FrameId{11}] = world.cam_from_world[FrameId{10}];
  EXPECT_EQ(world.NumConfirmed(UnconfirmedWith(world.Edge(1, 10, 10.0)), world.Edge(1, 11, 10.0)),
            0);
  EXPECT_EQ(world.NumConfirmed(UnconfirmedWith(world.Edge(1, 10), {.min_witness_deg = 0.0}),
                               world.Edge(1, 11)),
            2);
}

TEST(UnconfirmedEdges, FewMatchesProveNothing) {
  const TwoPieces world;
  EXPECT_EQ(world.NumConfirmed(UnconfirmedWith(world.Edge(1, 10, 0.0, 49)), world.Edge(2, 12)), 0);
  EXPECT_EQ(world.NumConfirmed(UnconfirmedWith(world.Edge(1, 10, 0.0, 50)), world.Edge(2, 12)), 2);
}

TEST(UnconfirmedEdges, OtherPiecesAreNoWitnesses) {
  TwoPieces world;
  world.truth[FrameId{20}] = world.cam_from_world[FrameId{20}] = Turned(-50.0);
  EXPECT_EQ(world.NumConfirmed(UnconfirmedWith(world.Edge(1, 20)), world.Edge(2, 12)), 0);
}

TEST(UnconfirmedEdges, RemovedOnesConfirmNothing) {
  const TwoPieces world;
  UnconfirmedEdges unconfirmed = UnconfirmedWith(world.Edge(1, 10));
  unconfirmed.Remove({world.Edge(2, 10)});
  EXPECT_EQ(world.NumConfirmed(unconfirmed, world.Edge(2, 12)), 2);
  unconfirmed.Remove({world.Edge(1, 10)});
  EXPECT_EQ(world.NumConfirmed(unconfirmed, world.Edge(2, 12)), 0);
}

}  // namespace
}  // namespace rotslam
