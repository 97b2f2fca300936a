#include "rotodom/relative_rotation/planar_ambiguity.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "rotodom/relative_rotation/relative_rotation.h"

namespace rotslam {
namespace {

constexpr double kWallFocalPx = 450.0;
constexpr double kThreshold = 1.5 / kWallFocalPx;

// A wall seen at a slant, from two places as far apart as a walk of a second or more; some points
// lie off it.
struct WallScene {
  std::vector<BearingPair> pairs;
  EpipolarModel truth;
};

struct WallSceneOptions {
  double noise_px = 0.0;
  double off_wall_ratio = 0.0;
  std::uint64_t seed = 1;
};

WallScene MakeWallScene(const WallSceneOptions& options) {
  std::mt19937_64 random(options.seed);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  std::normal_distribution<double> noise(0.0, options.noise_px / kWallFocalPx);
  const auto in_ball = [&](double radius) {
    return Eigen::Vector3d(
        radius * Eigen::Vector3d(uniform(random), uniform(random), uniform(random)).normalized());
  };
  const Eigen::Vector3d normal = (Eigen::Vector3d::UnitZ() + in_ball(0.7)).normalized();
  WallScene scene;
  scene.truth.j_from_i = Rotation::Exp(in_ball(30.0 * kRadFromDeg));
  scene.truth.direction = in_ball(1.0);
  const auto seen = [&](const Eigen::Vector3d& point) {
    return Eigen::Vector3d(Eigen::Vector3d(point.x() / point.z() + noise(random),
                                           point.y() / point.z() + noise(random),
                                           1.0)
                               .normalized());
  };
  while (scene.pairs.size() < 400) {
    const Eigen::Vector3d ray(0.6 * uniform(random), 0.4 * uniform(random), 1.0);
    const bool is_off = 0.5 * (uniform(random) + 1.0) < options.off_wall_ratio;
    const double depth = 4.0 / normal.dot(ray) * (is_off ? 0.75 + 0.2 * uniform(random) : 1.0);
    const Eigen::Vector3d in_i = depth * ray;
    const Eigen::Vector3d in_j = scene.truth.j_from_i * in_i + 0.6 * scene.truth.direction;
    if (!(in_j.z() > 0.2)) continue;
    scene.pairs.push_back({seen(in_i), seen(in_j)});
  }
  return scene;
}

double AngleBetweenDeg(const EpipolarModel& a, const EpipolarModel& b) {
  return (a.j_from_i * b.j_from_i.Inverse()).AngleDeg();
}

TEST(PlanarAmbiguity, FitsAllEpipolarLinesOfAPlane) {
  int num_far = 0;
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    const WallScene scene = MakeWallScene({.seed = seed});
    const PairArrays pairs(scene.pairs);
    const auto twin = PlanarAmbiguity(pairs, scene.truth, kThreshold);
    ASSERT_TRUE(twin) << seed;
    const std::vector<double> squared = SquaredDistances(pairs, *twin);
    EXPECT_LT(std::sqrt(*std::max_element(squared.begin(), squared.end())), 1e-7) << seed;
    num_far += AngleBetweenDeg(*twin, scene.truth) > 3.0;
  }
  EXPECT_GE(num_far, 40);
}

TEST(PlanarAmbiguity, TheTwinsTwinIsTheModel) {
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    const WallScene scene = MakeWallScene({.seed = seed});
    const PairArrays pairs(scene.pairs);
    const auto twin = PlanarAmbiguity(pairs, scene.truth, kThreshold);
    ASSERT_TRUE(twin) << seed;
    const auto again = PlanarAmbiguity(pairs, *twin, kThreshold);
    ASSERT_TRUE(again) << seed;
    EXPECT_LT(AngleBetweenDeg(*again, scene.truth), 1e-4) << seed;
    EXPECT_GT(std::abs(again->direction.dot(scene.truth.direction)), 1.0 - 1e-8) << seed;
  }
}

TEST(PlanarAmbiguity, PointsOffThePlaneDoNotPull) {
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    const WallScene clean = MakeWallScene({.seed = seed});
    const WallScene scene = MakeWallScene({.off_wall_ratio = 0.2, .seed = seed});
    const auto expected = PlanarAmbiguity(PairArrays(clean.pairs), clean.truth, kThreshold);
    const auto twin = PlanarAmbiguity(PairArrays(scene.pairs), scene.truth, kThreshold);
    ASSERT_TRUE(expected && twin) << seed;
    // Near enough for a descent.
    EXPECT_LT(AngleBetweenDeg(*twin, *expected), 1.0) << seed;
  }
}

TEST(PlanarAmbiguity, NoneWithoutBaselineOrPairs) {
  WallScene scene = MakeWallScene({});
  for (BearingPair& pair : scene.pairs) pair.bearing_j = scene.truth.j_from_i * pair.bearing_i;
  EXPECT_FALSE(PlanarAmbiguity(PairArrays(scene.pairs), scene.truth, kThreshold));
  scene.pairs.resize(9);
  EXPECT_FALSE(PlanarAmbiguity(PairArrays(scene.pairs), scene.truth, kThreshold));
  EXPECT_FALSE(PlanarAmbiguity(PairArrays(), scene.truth, kThreshold));
}

double AngleDeg(const RelativeRotationEstimate& estimate, const Rotation& j_from_i) {
  return (estimate.j_from_i * j_from_i.Inverse()).AngleDeg();
}

// Starts near the twin, as after a step whose prediction is off by that much.
std::vector<RelativeRotationEstimate> EstimateFromAmbiguity(const WallScene& scene,
                                                            const EpipolarModel& twin,
                                                            std::uint64_t sample_seed = 1) {
  return EstimateRotationHypotheses({scene.pairs}, twin.j_from_i, kWallFocalPx, {}, sample_seed);
}

// Some points off the wall tell the two apart, whatever the seed of the samples.
TEST(EstimateRelativeRotation, FindsTheMotionPastAWall) {
  int num_wrong = 0;
  int num_runs = 0;
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    const WallScene scene = MakeWallScene({.noise_px = 0.15, .off_wall_ratio = 0.1, .seed = seed});
    const auto twin = PlanarAmbiguity(PairArrays(scene.pairs), scene.truth, kThreshold);
    if (!twin) continue;
    for (const std::uint64_t sample_seed : {1, 2}) {
      const auto estimates = EstimateFromAmbiguity(scene, *twin, sample_seed);
      ASSERT_FALSE(estimates.empty());
      ++num_runs;
      num_wrong += AngleDeg(estimates.front(), scene.truth.j_from_i) > 1.0;
    }
  }
  EXPECT_GE(num_runs, 100);
  EXPECT_LE(num_wrong, 1);
  RecordProperty("num_wrong", num_wrong);
}

// Nothing but the wall: both motions fit, and the start is the wrong one's.
TEST(EstimateRotationHypotheses, HasBothMotionsOfAWall) {
  int num_ambiguous = 0;
  int num_offered = 0;
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    const WallScene scene = MakeWallScene({.noise_px = 0.15, .seed = seed});
    const auto twin = PlanarAmbiguity(PairArrays(scene.pairs), scene.truth, kThreshold);
    // A twin that puts half of the points behind the cameras is none.
    if (!twin || AngleBetweenDeg(*twin, scene.truth) < 4.0) continue;
    const auto estimates = EstimateFromAmbiguity(scene, *twin);
    ASSERT_FALSE(estimates.empty());
    if (AngleDeg(estimates.front(), scene.truth.j_from_i) < 1.0 && estimates.size() == 1) continue;
    ++num_ambiguous;
    num_offered += std::any_of(estimates.begin(), estimates.end(), [&](const auto& estimate) {
      return AngleDeg(estimate, scene.truth.j_from_i) < 1.0;
    });
    if (estimates.size() < 2) continue;
    EXPECT_EQ(estimates[0].excess, 0.0);
    EXPECT_GE(estimates[1].excess, 0.0);
    EXPECT_GT(AngleDeg(estimates[1], estimates[0].j_from_i), 1.0);
  }
  EXPECT_GE(num_ambiguous, 10);
  EXPECT_GE(num_offered, 0.95 * num_ambiguous);
  RecordProperty("num_ambiguous", num_ambiguous);
  RecordProperty("num_offered", num_offered);
}

TEST(EstimateRotationHypotheses, IsOneWherePointsHaveDepth) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const WallScene scene = MakeWallScene({.noise_px = 0.15, .off_wall_ratio = 0.6, .seed = seed});
    const auto estimates = EstimateRotationHypotheses(
        {scene.pairs}, scene.truth.j_from_i, kWallFocalPx, {}, /*seed=*/1);
    ASSERT_EQ(estimates.size(), 1u) << seed;
    EXPECT_LT(AngleDeg(estimates.front(), scene.truth.j_from_i), 1.0) << seed;
  }
}

TEST(EstimateRotationHypotheses, IsEmptyForTooFewPairs) {
  WallScene scene = MakeWallScene({});
  scene.pairs.resize(9);
  EXPECT_TRUE(
      EstimateRotationHypotheses({scene.pairs}, scene.truth.j_from_i, kWallFocalPx, {}, 1).empty());
}

}  // namespace
}  // namespace rotslam
