#include "krot/initialisation/resection.h"

#include <gtest/gtest.h>

#include "tests/scenes/scene.h"

namespace rotslam {
namespace {

std::vector<PosedRay> RaysFrom(const Eigen::Vector3d& center, int count, SceneRandom& random) {
  std::vector<PosedRay> rays;
  for (int k = 0; k < count; ++k) {
    const Eigen::Vector3d point(
        random.Uniform(-4, 4), random.Uniform(-3, 3), random.Uniform(5, 15));
    rays.push_back({Rotation(), point, (center - point).normalized()});
  }
  return rays;
}

TEST(ResectCenter, IsExactOnExactRays) {
  SceneRandom random(3);
  const Eigen::Vector3d center(0.7, -0.2, 1.1);
  for (const int count : {3, 5, 50}) {
    const auto resection = ResectCenter(RaysFrom(center, count, random), {});
    ASSERT_TRUE(resection) << count;
    EXPECT_LT((resection->center_in_world - center).norm(), 1e-9) << count;
    EXPECT_EQ(static_cast<int>(resection->inliers.size()), count);
  }
}

TEST(ResectCenter, ForgetsFortyPercentOfWrongRays) {
  SceneRandom random(4);
  const Eigen::Vector3d center(0.7, -0.2, 1.1);
  std::vector<PosedRay> rays = RaysFrom(center, 100, random);
  for (int k = 0; k < 40; ++k) {
    rays[k].bearing =
        -Eigen::Vector3d(random.Uniform(-1, 1), random.Uniform(-1, 1), 1.0).normalized();
  }
  const auto resection = ResectCenter(rays, {});
  ASSERT_TRUE(resection);
  EXPECT_LT((resection->center_in_world - center).norm(), 0.02);
  EXPECT_GE(resection->inliers.size(), 60u);
}

TEST(ResectCenter, RefusesTooFewAndParallelRays) {
  SceneRandom random(5);
  EXPECT_FALSE(ResectCenter(RaysFrom(Eigen::Vector3d::Zero(), 2, random), {}));
  EXPECT_FALSE(ResectCenter({}, {}));
  std::vector<PosedRay> parallel;
  for (int k = 0; k < 10; ++k) {
    parallel.push_back({Rotation(), Eigen::Vector3d(0, 0, 5.0 + k), -Eigen::Vector3d::UnitZ()});
  }
  EXPECT_FALSE(ResectCenter(parallel, {}));
}

}  // namespace
}  // namespace rotslam
