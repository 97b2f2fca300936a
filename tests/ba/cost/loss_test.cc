#include "ba/cost/loss.h"

#include <cmath>

#include <gtest/gtest.h>

namespace rotslam {
namespace {

constexpr double kBend = 1.5;

TEST(UnderHuberLoss, IsAsLongAsTheRootOfCeresLoss) {
  const ceres::HuberLoss loss(kBend);
  for (const double length : {0.0, 1.0, 1.499, 1.501, 4.0, 100.0}) {
    const Eigen::Vector2d residual = length * Eigen::Vector2d(0.6, -0.8);
    double rho[3];
    loss.Evaluate(residual.squaredNorm(), rho);
    const RobustResidual robust = UnderHuberLoss(residual, kBend);
    EXPECT_NEAR(robust.value.squaredNorm(), rho[0], 1e-12 * (1.0 + rho[0])) << length;
    // The gradient of half the loss.
    EXPECT_LT((robust.weight.transpose() * robust.value - rho[1] * residual).norm(), 1e-12)
        << length;
  }
}

TEST(UnderHuberLoss, CurvesAcrossAsTheLossDoesAndAlongLess) {
  const double length = 4.0;
  const RobustResidual robust = UnderHuberLoss({length, 0.0}, kBend);
  const Eigen::Matrix2d curvature = robust.weight.transpose() * robust.weight;
  EXPECT_NEAR(curvature(1, 1), kBend / length, 1e-12);
  EXPECT_NEAR(curvature(0, 1), 0.0, 1e-12);
  EXPECT_LT(curvature(0, 0), 0.65 * curvature(1, 1));
  EXPECT_GT(curvature(0, 0), 0.0);
}

TEST(UnderHuberLoss, LeavesShortResidualsAlone) {
  for (const double bend : {0.0, kBend}) {
    const Eigen::Vector2d residual(1.0, bend == 0.0 ? 100.0 : 0.5);
    const RobustResidual robust = UnderHuberLoss(residual, bend);
    EXPECT_EQ(robust.value, residual);
    EXPECT_EQ(robust.weight, Eigen::Matrix2d::Identity());
  }
}

}  // namespace
}  // namespace rotslam
