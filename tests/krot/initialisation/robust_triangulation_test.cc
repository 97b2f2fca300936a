#include "krot/initialisation/robust_triangulation.h"

#include <algorithm>

#include <gtest/gtest.h>

namespace rotslam {
namespace {

std::vector<PosedRay> RaysOf(const Eigen::Vector3d& point, int count) {
  std::vector<PosedRay> rays(count);
  for (int k = 0; k < count; ++k) {
    rays[k].cam_from_world = Rotation::Exp({0.0, 0.03 * k, 0.0});
    rays[k].center_in_world = Eigen::Vector3d(0.4 * k, 0.05 * k * k, 0.0);
    rays[k].bearing = (rays[k].cam_from_world * (point - rays[k].center_in_world)).normalized();
  }
  return rays;
}

TEST(TriangulateRobustly, NamesTheWrongSightings) {
  const Eigen::Vector3d truth(0.5, -0.4, 6.0);
  for (const int count : {4, 7, 15}) {
    std::vector<PosedRay> rays = RaysOf(truth, count);
    rays[2].bearing = Eigen::Vector3d(0.4, 0.3, 1.0).normalized();
    const auto point = TriangulateRobustly(rays, 0.01, 0.005);
    ASSERT_TRUE(point) << count;
    EXPECT_LT((point->point_in_world - truth).norm(), 1e-9) << count;
    EXPECT_EQ(static_cast<int>(point->inliers.size()), count - 1);
    EXPECT_EQ(std::count(point->inliers.begin(), point->inliers.end(), 2), 0);
  }
}

TEST(TriangulateRobustly, RefusesWithoutMajorityOrParallax) {
  const Eigen::Vector3d truth(0.5, -0.4, 6.0);
  std::vector<PosedRay> two = RaysOf(truth, 2);
  two[1].bearing = Eigen::Vector3d(0.4, 0.9, 1.0).normalized();
  EXPECT_FALSE(TriangulateRobustly(two, 0.01, 0.005));
  EXPECT_FALSE(TriangulateRobustly(RaysOf({0.0, 0.0, 1e5}, 5), 0.01, 0.005));
  EXPECT_FALSE(TriangulateRobustly({}, 0.01, 0.005));
}

}  // namespace
}  // namespace rotslam
