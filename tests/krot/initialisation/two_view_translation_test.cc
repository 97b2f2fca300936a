#include "krot/initialisation/two_view_translation.h"

#include <cmath>
#include <map>

#include <gtest/gtest.h>

#include "tests/scenes/scene.h"

namespace rotslam {
namespace {

// The rays of two views of a scene to the points they share, with the true direction.
struct TwoViews {
  std::vector<RayPair> pairs;
  Eigen::Vector3d direction_in_world;
};

TwoViews FirstTwo(const SceneOptions& options) {
  const Scene scene = MakeScene(options);
  const FrameId a{0};
  const FrameId b{1};
  TwoViews views;
  for (const Track& track : scene.tracks) {
    std::map<FrameId, Eigen::Vector3d> rays;
    for (const Observation& observation : track.observations) {
      rays[observation.frame] =
          scene.cam_from_world.at(observation.frame).Inverse() * observation.bearing;
    }
    if (rays.contains(a) && rays.contains(b)) views.pairs.push_back({rays.at(a), rays.at(b)});
  }
  views.direction_in_world =
      (scene.true_center_in_world.at(b) - scene.true_center_in_world.at(a)).normalized();
  return views;
}

SceneOptions Random(std::uint64_t seed) {
  SceneOptions options;
  options.num_views = 2;
  options.num_points = 300;
  options.path = ScenePath::kRandom;
  options.seed = seed;
  return options;
}

double AngleDeg(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return kDegFromRad * std::atan2(a.cross(b).norm(), a.dot(b));
}

TEST(EstimateTwoViewTranslation, FindsTheDirectionWithItsSign) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const TwoViews views = FirstTwo(Random(seed));
    const auto found = EstimateTwoViewTranslation(views.pairs);
    ASSERT_TRUE(found) << seed;
    EXPECT_LT(AngleDeg(found->direction_in_world, views.direction_in_world), 1e-6) << seed;
    EXPECT_EQ(found->inliers.size(), views.pairs.size()) << seed;
    EXPECT_EQ(found->front_ratio, 1.0) << seed;
  }
}

TEST(EstimateTwoViewTranslation, FindsItDrivingForward) {
  SceneOptions street;
  street.num_views = 2;
  street.num_points = 400;
  street.noise_px = 0.3;
  street.path = ScenePath::kStreet;
  const TwoViews views = FirstTwo(street);
  const auto found = EstimateTwoViewTranslation(views.pairs);
  ASSERT_TRUE(found);
  EXPECT_LT(AngleDeg(found->direction_in_world, views.direction_in_world), 2.0);
}

TEST(EstimateTwoViewTranslation, OutvotesWrongMatches) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    SceneOptions options = Random(seed);
    options.noise_px = 0.5;
    options.outlier_ratio = 0.15;  // of observations: 28 % of the pairs
    const TwoViews views = FirstTwo(options);
    const auto found = EstimateTwoViewTranslation(views.pairs);
    ASSERT_TRUE(found) << seed;
    EXPECT_LT(AngleDeg(found->direction_in_world, views.direction_in_world), 1.5) << seed;
  }
}

TEST(EstimateTwoViewTranslation, ViewsInTheOtherOrderGiveTheOtherSign) {
  const TwoViews views = FirstTwo(Random(3));
  std::vector<RayPair> swapped;
  for (const RayPair& pair : views.pairs) {
    swapped.push_back({pair.ray_b_in_world, pair.ray_a_in_world});
  }
  const auto found = EstimateTwoViewTranslation(views.pairs);
  const auto back = EstimateTwoViewTranslation(swapped);
  ASSERT_TRUE(found && back);
  EXPECT_LT((found->direction_in_world + back->direction_in_world).norm(), 1e-9);
}

TEST(EstimateTwoViewTranslation, SaysNoWithoutParallaxOrPairs) {
  SceneOptions pivot;
  pivot.num_views = 2;
  pivot.path = ScenePath::kPivot;
  pivot.noise_px = 0.5;
  const TwoViews views = FirstTwo(pivot);
  ASSERT_GT(views.pairs.size(), 20u);
  EXPECT_FALSE(EstimateTwoViewTranslation(views.pairs));
  EXPECT_FALSE(EstimateTwoViewTranslation({}));
  const std::vector<RayPair> few(4, FirstTwo(Random(1)).pairs[0]);
  EXPECT_FALSE(EstimateTwoViewTranslation(few));
}

}  // namespace
}  // namespace rotslam
