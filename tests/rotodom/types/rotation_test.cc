#include "rotodom/types/rotation.h"

#include <limits>
#include <stdexcept>

#include <gtest/gtest.h>

namespace rotslam {
namespace {

const Eigen::Vector3d kVectors[] = {
    {0.0, 0.0, 0.0}, {1e-9, -2e-9, 1e-10}, {0.1, -0.2, 0.3}, {3.0, 0.4, -0.5}, {0.0, 0.0, 3.1415}};

TEST(Rotation, LogUndoesExp) {
  for (const Eigen::Vector3d& vector : kVectors) {
    EXPECT_LT((Rotation::Exp(vector).Log() - vector).norm(), 1e-12) << vector.transpose();
  }
}

TEST(Rotation, GroupLaws) {
  for (const Eigen::Vector3d& a : kVectors) {
    for (const Eigen::Vector3d& b : kVectors) {
      const Rotation A = Rotation::Exp(a);
      const Rotation B = Rotation::Exp(b);
      EXPECT_LT(((A * B).Matrix() - A.Matrix() * B.Matrix()).norm(), 1e-14);
      EXPECT_LT(((A * B) * (A * B).Inverse()).Angle(), 1e-14);
      EXPECT_LT((A * (B * a) - (A * B) * a).norm(), 1e-13);
    }
  }
}

TEST(Rotation, SkewIsTheCrossProduct) {
  const Eigen::Vector3d a(1.0, 2.0, 3.0);
  const Eigen::Vector3d b(-0.3, 0.7, 0.2);
  EXPECT_LT((Skew(a) * b - a.cross(b)).norm(), 1e-15);
}

TEST(Rotation, StaysUnitThroughLongProducts) {
  const Rotation step = Rotation::Exp({0.01, 0.02, -0.03});
  Rotation product;
  for (int k = 0; k < 100000; ++k) product = product * step;
  EXPECT_NEAR(product.Quaternion().norm(), 1.0, 1e-14);
}

TEST(Rotation, FromMatrixRejectsWhatIsNoRotation) {
  EXPECT_THROW(Rotation::FromMatrix(2.0 * Eigen::Matrix3d::Identity()), std::invalid_argument);
  EXPECT_THROW(Rotation::FromMatrix(-Eigen::Matrix3d::Identity()), std::invalid_argument);
  EXPECT_THROW(
      Rotation::FromMatrix(Eigen::Matrix3d::Constant(std::numeric_limits<double>::quiet_NaN())),
      std::invalid_argument);
  EXPECT_THROW(Rotation(Eigen::Quaterniond(0.0, 0.0, 0.0, 0.0)), std::invalid_argument);
}

TEST(Rotation, InterpolatesAlongTheShortWay) {
  const Rotation a = Rotation::Exp({0.2, 0.0, 0.0});
  const Rotation b = Rotation::Exp({0.6, 0.0, 0.0});
  EXPECT_LT((Interpolate(a, b, 0.25).Log() - Eigen::Vector3d(0.3, 0.0, 0.0)).norm(), 1e-14);
  EXPECT_LT((Interpolate(a, b, 0.0).Inverse() * a).Angle(), 1e-14);
  EXPECT_LT((Interpolate(a, b, 1.0).Inverse() * b).Angle(), 1e-14);
}

}  // namespace
}  // namespace rotslam
