#include "rotodom/averaging/support/view_support.h"

#include <random>

#include <Eigen/LU>
#include <gtest/gtest.h>

#include "rotodom/averaging/support/edge_positions.h"
#include "rotodom/averaging/support/orientation_deviations.h"
#include "tests/scenes/wrong_edges.h"

namespace rotslam {
namespace {

using Pairs = std::vector<std::pair<int, int>>;

std::vector<RelativeRotation> EdgesOf(const Pairs& pairs) {
  std::vector<RelativeRotation> edges;
  for (const auto& [i, j] : pairs) {
    RelativeRotation& edge = edges.emplace_back();
    edge.i = FrameId{i};
    edge.j = FrameId{j};
  }
  return edges;
}

std::vector<int> Support(const Pairs& pairs,
                         const std::set<FrameId>& held_views = {},
                         const std::set<int>& outliers = {}) {
  const std::vector<RelativeRotation> edges = EdgesOf(pairs);
  std::vector<char> is_inlier(edges.size(), 1);
  for (const int k : outliers) is_inlier[k] = 0;
  std::vector<int> support;
  for (const auto& [view, value] : SupportOfViews(edges, is_inlier, held_views)) {
    support.push_back(value);
  }
  return support;
}

const Pairs kTriangleWithTail = {{0, 1}, {1, 2}, {2, 0}, {2, 3}, {3, 4}};

TEST(SupportOfViews, IsTheNumberOfEdgesThatHoldAView) {
  EXPECT_EQ(Support(kTriangleWithTail), (std::vector{2, 2, 2, 1, 1}));
  EXPECT_EQ(Support({{0, 1}, {1, 2}, {2, 0}, {0, 3}, {1, 3}, {2, 3}}), (std::vector{3, 3, 3, 3}));
  // The same pair twice counts twice.
  EXPECT_EQ(Support({{0, 1}, {1, 2}, {2, 0}, {2, 3}, {3, 2}}), (std::vector{2, 2, 2, 2}));
  EXPECT_EQ(Support({{0, 1}, {1, 2}, {2, 0}, {2, 3}}, {}, {3}), (std::vector{2, 2, 2, 0}));
}

// Two triangles joined by one edge: the smaller side hangs, or the one without a fixed view.
TEST(SupportOfViews, IsOneBehindABridge) {
  const Pairs bridged = {{0, 1}, {1, 2}, {2, 0}, {2, 3}, {3, 4}, {4, 5}, {5, 3}, {5, 6}, {6, 3}};
  EXPECT_EQ(Support(bridged), (std::vector{1, 1, 1, 2, 2, 2, 2}));
  EXPECT_EQ(Support(bridged, {FrameId{1}}), (std::vector{2, 2, 2, 1, 1, 1, 1}));
  EXPECT_EQ(Support(bridged, {FrameId{1}, FrameId{5}}), (std::vector{2, 2, 2, 2, 2, 2, 2}));
}

// Against the inverse of the full matrix.
TEST(DeviationsOfViews, AreTheInverseOfTheNormalEquations) {
  WrongEdges scene = MakeWrongEdges({.num_views = 30, .wrong_ratio = 0.0});
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  for (RelativeRotation& edge : scene.edges) {
    Eigen::Matrix3d A;
    for (double& value : A.reshaped()) value = 0.01 * normal(random);
    edge.covariance = A * A.transpose() + 1e-5 * Eigen::Matrix3d::Identity();
  }
  std::vector<double> weights(scene.edges.size(), 1.0);
  weights[2] = 0.0;
  weights[3] = 0.25;
  const int n = 30;
  Eigen::MatrixXd full = Eigen::MatrixXd::Zero(3 * n, 3 * n);
  for (std::size_t k = 0; k < scene.edges.size(); ++k) {
    const RelativeRotation& edge = scene.edges[k];
    const Eigen::Matrix3d R = scene.true_cam_from_world.at(edge.j).Matrix();
    const Eigen::Matrix3d block = weights[k] * R.transpose() * edge.covariance.inverse() * R;
    const int i = 3 * edge.i.value;
    const int j = 3 * edge.j.value;
    full.block<3, 3>(i, i) += block;
    full.block<3, 3>(j, j) += block;
    full.block<3, 3>(i, j) -= block;
    full.block<3, 3>(j, i) -= block;
  }
  const auto expect = [&](const Eigen::MatrixXd& covariance, const std::set<FrameId>& held) {
    const OrientationDeviations deviations =
        DeviationsOfViews(scene.edges, weights, scene.true_cam_from_world, held);
    EXPECT_TRUE(deviations.is_complete);
    ASSERT_EQ(deviations.covariance.size(), 30u);
    for (const auto& [view, found] : deviations.covariance) {
      const Eigen::Matrix3d R = scene.true_cam_from_world.at(view).Matrix();
      const Eigen::Matrix3d expected =
          R * covariance.block<3, 3>(3 * view.value, 3 * view.value) * R.transpose();
      EXPECT_LT((found - expected).norm(), 1e-9 * covariance.norm()) << view.value;
    }
  };
  Eigen::MatrixXd one_fixed = Eigen::MatrixXd::Zero(3 * n, 3 * n);
  one_fixed.bottomRightCorner(3 * n - 3, 3 * n - 3) =
      full.bottomRightCorner(3 * n - 3, 3 * n - 3).inverse();
  expect(one_fixed, {FrameId{0}});
  // Without a fixed view: relative to the mean.
  Eigen::MatrixXd minus_mean = Eigen::MatrixXd::Identity(3 * n, 3 * n);
  for (int a = 0; a < n; ++a) {
    for (int b = 0; b < n; ++b)
      minus_mean.block<3, 3>(3 * a, 3 * b) -= Eigen::Matrix3d::Identity() / n;
  }
  expect(minus_mean * one_fixed * minus_mean.transpose(), {});
}

TEST(DeviationsOfViews, GrowAlongAChainAndEndWhereNothingTies) {
  const std::vector<RelativeRotation> edges = EdgesOf({{0, 1}, {1, 2}, {2, 3}, {5, 6}});
  RotationMap cam_from_world;
  for (int k = 0; k < 7; ++k) cam_from_world[FrameId{k}] = Rotation();
  const OrientationDeviations deviations =
      DeviationsOfViews(edges, {1.0, 1.0, 0.0, 1.0}, cam_from_world, {FrameId{0}});
  EXPECT_NEAR(deviations.covariance.at(FrameId{2})(0, 0), 2.0, 1e-12);
  EXPECT_FALSE(deviations.covariance.contains(FrameId{3}));
  EXPECT_NEAR(deviations.covariance.at(FrameId{5})(1, 1), 0.25, 1e-12);
}

TEST(FitCenters, FindsTheCentresOfExactTranslations) {
  const WrongEdges scene = MakeWrongEdges({.num_views = 40, .wrong_ratio = 0.0});
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  CenterMap truth;
  for (const auto& [view, rotation] : scene.true_cam_from_world) {
    truth[view] = {normal(random), normal(random), normal(random)};
  }
  std::vector<Eigen::Vector3d> j_in_i;
  std::vector<double> weights;
  for (const RelativeRotation& edge : scene.edges) {
    j_in_i.push_back(scene.true_cam_from_world.at(edge.i) * (truth.at(edge.j) - truth.at(edge.i)));
    weights.push_back(1.0 + std::abs(normal(random)));
  }
  weights[1] = 0.0;
  j_in_i[1].setConstant(1e6);
  const CenterMap found = FitCenters(scene.edges,
                                     j_in_i,
                                     weights,
                                     scene.true_cam_from_world,
                                     {{FrameId{0}, truth.at(FrameId{0})}},
                                     {});
  ASSERT_EQ(found.size(), truth.size());
  for (const auto& [view, center] : found) {
    EXPECT_LT((center - truth.at(view)).norm(), 1e-8) << view.value;
  }
}

// Two measurements of one step: their weighted mean.
TEST(FitCenters, WeighsWhatDisagrees) {
  const std::vector<RelativeRotation> edges = EdgesOf({{0, 1}, {0, 1}});
  const RotationMap cam_from_world = {{FrameId{0}, Rotation()}, {FrameId{1}, Rotation()}};
  const std::vector<Eigen::Vector3d> j_in_i = {{1, 0, 0}, {5, 0, 0}};
  const std::vector<double> weights = {3.0, 1.0};
  const CenterMap found = FitCenters(edges, j_in_i, weights, cam_from_world, {}, {});
  EXPECT_NEAR(found.at(FrameId{1}).x(), 2.0, 1e-9);
}

}  // namespace
}  // namespace rotslam
