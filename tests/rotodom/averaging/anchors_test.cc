#include "rotodom/averaging/anchors.h"

#include <random>
#include <stdexcept>
#include <vector>

#include <Eigen/Dense>
#include <gtest/gtest.h>

namespace rotslam {
namespace {

const Eigen::Vector3d kSigmas(1e-3, 3e-3, 1e-2);
const Eigen::Matrix3d kCovariance = kSigmas.cwiseAbs2().asDiagonal();

AveragingOptions Plain() {
  AveragingOptions options;
  options.edge_error_factor = 1.0;
  options.edge_floor_deg = 1e-9;
  return options;
}

// Views that turn by 40 deg each; edges from each to the next.
struct Chain {
  ViewGraph graph;
  RotationMap truth;
  RotationMap cam_from_world;  // chained from the first view on

  explicit Chain(int num_views, std::uint64_t seed = 0) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal;
    const Rotation turn = Rotation::Exp(Eigen::Vector3d(0.4, 0.5, 0.3));
    truth[FrameId{0}] = cam_from_world[FrameId{0}] = Rotation();
    for (int k = 1; k < num_views; ++k) {
      const double x = normal(random);
      const double y = normal(random);
      const Eigen::Vector3d error = kSigmas.cwiseProduct(Eigen::Vector3d(x, y, normal(random)));
      RelativeRotation edge{FrameId{k - 1}, FrameId{k}, turn};
      if (seed > 0) edge.j_from_i = Rotation::Exp(error) * turn;
      edge.covariance = kCovariance;
      graph.AddEdge(edge);
      truth[FrameId{k}] = turn * truth[FrameId{k - 1}];
      cam_from_world[FrameId{k}] = edge.j_from_i * cam_from_world[FrameId{k - 1}];
    }
  }
};

TEST(FollowAnchors, TurnsWithThemHoweverFar) {
  const Chain chain(30);
  const Rotation turned = Rotation::Exp({0.0, 0.4, 0.0});
  RotationMap refined;
  for (const int anchor : {0, 10, 20}) {
    refined[FrameId{anchor}] = chain.truth.at(FrameId{anchor}) * turned;
  }
  const RotationMap following = FollowAnchors(chain.graph, chain.truth, refined, Plain());
  ASSERT_EQ(following.size(), chain.truth.size());
  for (const auto& [view, rotation] : chain.truth) {
    EXPECT_LT((following.at(view) * (rotation * turned).Inverse()).AngleDeg(), 1e-6) << view.value;
  }
}

TEST(FollowAnchors, SharesOutWhatTwoOfThemDifferBy) {
  Chain chain(11);
  for (RelativeRotation edge : std::vector(chain.graph.edges())) {
    edge.covariance = 1e-6 * Eigen::Matrix3d::Identity();
    chain.graph.AddEdge(edge);
  }
  const Rotation turned = Rotation::Exp({0.0, 0.0, 0.01});
  const RotationMap refined = {{FrameId{0}, chain.truth.at(FrameId{0})},
                               {FrameId{10}, chain.truth.at(FrameId{10}) * turned}};
  const RotationMap following = FollowAnchors(chain.graph, chain.truth, refined, Plain());
  EXPECT_EQ(following.at(FrameId{10}).Quaternion().coeffs(),
            refined.at(FrameId{10}).Quaternion().coeffs());
  for (int k = 1; k <= 10; ++k) {
    const FrameId i{k - 1};
    const FrameId j{k};
    const Rotation step = following.at(j) * following.at(i).Inverse();
    const Rotation edge = chain.truth.at(j) * chain.truth.at(i).Inverse();
    EXPECT_NEAR((step * edge.Inverse()).Angle(), 0.001, 1e-6) << k;
  }
}

TEST(FollowAnchors, WantsOne) {
  const Chain chain(3);
  EXPECT_THROW(FollowAnchors(chain.graph, chain.truth, {}, Plain()), std::invalid_argument);
}

TEST(AnchorCovariances, GrowAlongTheWay) {
  const Chain chain(4);
  const auto covariances = AnchorCovariances(chain.graph, chain.truth, {FrameId{0}}, Plain());
  ASSERT_EQ(covariances.size(), 3U);
  EXPECT_TRUE(covariances.at(FrameId{1}).isApprox(kCovariance, 1e-9));
  EXPECT_NEAR(covariances.at(FrameId{3}).trace(), 3.0 * kCovariance.trace(), 1e-12);
}

TEST(AnchorCovariances, AreThoseOfTheErrors) {
  constexpr int kRuns = 400;
  double sum = 0.0;
  for (int run = 1; run <= kRuns; ++run) {
    const Chain chain(6, run);
    const FrameId last{5};
    const Eigen::Matrix3d covariance =
        AnchorCovariances(chain.graph, chain.cam_from_world, {FrameId{0}}, Plain()).at(last);
    const Eigen::Vector3d error =
        (chain.cam_from_world.at(last) * chain.truth.at(last).Inverse()).Log();
    sum += error.dot(covariance.inverse() * error);
  }
  EXPECT_NEAR(sum / kRuns, 3.0, 0.5);  // standard deviation of the mean is 0.12
}

TEST(AnchorCovariances, ComeFromTheNearestAnchorOnEitherSide) {
  const Chain chain(6);
  const auto covariances =
      AnchorCovariances(chain.graph, chain.truth, {FrameId{0}, FrameId{5}}, Plain());
  EXPECT_FALSE(covariances.contains(FrameId{0}));
  EXPECT_FALSE(covariances.contains(FrameId{5}));
  for (const auto& [view, steps] : {std::pair{1, 1}, {2, 2}, {3, 2}, {4, 1}}) {
    EXPECT_NEAR(covariances.at(FrameId{view}).trace(), steps * kCovariance.trace(), 1e-12) << view;
  }
}

TEST(AnchorCovariances, AWrongEdgeIsNoWay) {
  Chain chain(4);
  RelativeRotation wrong{FrameId{0}, FrameId{3}, Rotation::Exp(Eigen::Vector3d(0.2, 0.0, 0.0))};
  wrong.covariance = 1e-12 * Eigen::Matrix3d::Identity();
  chain.graph.AddEdge(wrong);
  const auto covariances = AnchorCovariances(chain.graph, chain.truth, {FrameId{0}}, Plain());
  EXPECT_NEAR(covariances.at(FrameId{3}).trace(), 3.0 * kCovariance.trace(), 1e-12);
}

TEST(AnchorCovariances, LeavesOutWhatNoPathReaches) {
  Chain chain(3);
  chain.truth[FrameId{7}] = Rotation();
  RelativeRotation unknown{FrameId{2}, FrameId{9}, Rotation()};
  chain.graph.AddEdge(unknown);
  const auto covariances =
      AnchorCovariances(chain.graph, chain.truth, {FrameId{0}, FrameId{8}}, Plain());
  EXPECT_EQ(covariances.size(), 2U);
  EXPECT_TRUE(AnchorCovariances(chain.graph, chain.truth, {}, Plain()).empty());
  AveragingOptions bad;
  bad.window = 0;
  EXPECT_THROW(AnchorCovariances(chain.graph, chain.truth, {}, bad), std::invalid_argument);
}

}  // namespace
}  // namespace rotslam
