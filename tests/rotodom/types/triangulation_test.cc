#include "rotodom/types/triangulation.h"

#include <gtest/gtest.h>

namespace rotslam {
namespace {

std::vector<PosedRay> RaysOf(const Eigen::Vector3d& point, int count) {
  std::vector<PosedRay> rays(count);
  for (int k = 0; k < count; ++k) {
    rays[k].cam_from_world = Rotation::Exp({0.02 * k, -0.05 * k, 0.1 * k});
    rays[k].center_in_world = Eigen::Vector3d(0.3 * k, 0.1 * k * k, -0.05 * k);
    rays[k].bearing = (rays[k].cam_from_world * (point - rays[k].center_in_world)).normalized();
  }
  return rays;
}

TEST(Triangulate, FindsTheTruthFromCleanSightings) {
  const Eigen::Vector3d truth(0.4, -0.3, 5.0);
  for (const int count : {2, 3, 8}) {
    const auto point = Triangulate(RaysOf(truth, count), 1e-4);
    ASSERT_TRUE(point) << count;
    EXPECT_LT((*point - truth).norm(), 1e-9) << count;
  }
}

TEST(Triangulate, RefusesParallelRaysAndPointsBehind) {
  EXPECT_FALSE(Triangulate(RaysOf({0.0, 0.0, 1e6}, 2), 1e-3));
  std::vector<PosedRay> behind = RaysOf({0.4, -0.3, 5.0}, 3);
  for (PosedRay& ray : behind) ray.bearing = -ray.bearing;
  EXPECT_FALSE(Triangulate(behind, 1e-4));
  std::vector<PosedRay> same = RaysOf({0.4, -0.3, 5.0}, 2);
  same[1] = same[0];
  EXPECT_FALSE(Triangulate(same, 1e-4));
}

TEST(TriangulationAngle, IsTheLargestPairwiseAngle) {
  std::vector<PosedRay> rays(2);
  rays[0].center_in_world = {-1.0, 0.0, 0.0};
  rays[1].center_in_world = {1.0, 0.0, 0.0};
  EXPECT_NEAR(TriangulationAngle(rays, {0.0, 0.0, 1.0}), 1.5707963267948966, 1e-12);
}

}  // namespace
}  // namespace rotslam
