#include "rotodom/types/similarity.h"

#include <gtest/gtest.h>

namespace rotslam {
namespace {

const Similarity kMove = {2.5, Rotation::Exp({0.3, -0.2, 0.7}), {1.0, -2.0, 3.0}};
const Eigen::Vector3d kPoint(0.4, 0.5, -0.6);

TEST(Similarity, GoesThereAndBack) {
  EXPECT_LT((kMove.Inverse().Move(kMove.Move(kPoint)) - kPoint).norm(), 1e-14);
}

TEST(Similarity, AfterAnotherIsBoth) {
  const Similarity other = {0.3, Rotation::Exp({-1.0, 0.1, 0.2}), {-5.0, 0.0, 0.5}};
  EXPECT_LT(((kMove * other).Move(kPoint) - kMove.Move(other.Move(kPoint))).norm(), 1e-14);
  const Rotation cam_from_world = Rotation::Exp({0.1, 0.2, 0.3});
  const Rotation rest =
      (kMove * other).Move(cam_from_world) * kMove.Move(other.Move(cam_from_world)).Inverse();
  EXPECT_LT(rest.Angle(), 1e-14);
}

TEST(Similarity, LeavesWhatACameraSees) {
  const Rotation cam_from_world = Rotation::Exp({0.1, 0.2, 0.3});
  const Eigen::Vector3d center(1.0, 1.0, 1.0);
  const Eigen::Vector3d seen = cam_from_world * (kPoint - center);
  const Eigen::Vector3d moved =
      kMove.Move(cam_from_world) * (kMove.Move(kPoint) - kMove.Move(center));
  EXPECT_LT((moved - kMove.scale * seen).norm(), 1e-14);
}

}  // namespace
}  // namespace rotslam
