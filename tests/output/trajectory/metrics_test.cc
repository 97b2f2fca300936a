#include "output/trajectory/metrics.h"

#include <cmath>
#include <numbers>
#include <random>

#include <gtest/gtest.h>

namespace rotslam {
namespace {

const Eigen::Vector3d kAxis = Eigen::Vector3d(1.0, -2.0, 0.5).normalized();

// One metre and one degree a pose around a circle, ten poses a second.
Trajectory Circle(int num_poses) {
  const double radius_m = 180.0 / std::numbers::pi;
  Trajectory trajectory;
  for (int k = 0; k < num_poses; ++k) {
    const double angle = k * kRadFromDeg;
    trajectory.push_back({0.1 * k,
                          Rotation::Exp({0.0, angle, 0.0}),
                          radius_m * Eigen::Vector3d(std::sin(angle), 0.0, std::cos(angle))});
  }
  return trajectory;
}

TrajectoryMetrics Compare(const Trajectory& ground_truth, const Trajectory& estimate) {
  return ComputeMetrics(AssociatePoses(ground_truth, estimate, {}), {});
}

// The same motion seen from another world, scaled.
Trajectory Moved(Trajectory trajectory,
                 const Rotation& other_from_world,
                 const Eigen::Vector3d& offset,
                 double scale) {
  for (StampedPose& pose : trajectory) {
    pose.world_from_cam = other_from_world * pose.world_from_cam;
    pose.center_in_world = scale * (other_from_world * pose.center_in_world) + offset;
  }
  return trajectory;
}

TEST(Metrics, AreZeroForTheTruthInAnyWorldAndScale) {
  const Trajectory truth = Circle(150);
  const Trajectory estimate =
      Moved(truth, Rotation::Exp({0.3, -2.0, 1.0}), Eigen::Vector3d(5.0, -9.0, 100.0), 0.25);
  const TrajectoryMetrics metrics = Compare(truth, estimate);
  EXPECT_EQ(metrics.num_poses, 150);
  EXPECT_LT(metrics.rpe1_max_deg, 1e-10);
  EXPECT_LT(metrics.rpen_deg, 1e-10);
  EXPECT_LT(metrics.r_err_deg_per_100m.value(), 1e-10);
  EXPECT_LT(metrics.ate_m.value(), 1e-10);
  EXPECT_NEAR(metrics.scale.value(), 4.0, 1e-12);
}

TEST(Metrics, FollowClosedFormsForAConstantDrift) {
  // drift_deg about one axis in every step: D_k^-1 D_l turns by (l - k) drift_deg exactly.
  const double drift_deg = 0.02;
  const int n = 301;
  const Trajectory truth = Circle(n);
  Trajectory estimate = truth;
  for (int k = 0; k < n; ++k) {
    estimate[k].world_from_cam =
        Rotation::Exp(k * drift_deg * kRadFromDeg * kAxis) * truth[k].world_from_cam;
  }
  const TrajectoryMetrics metrics = Compare(truth, estimate);
  EXPECT_NEAR(metrics.rpe1_deg, drift_deg, 1e-10);
  EXPECT_NEAR(metrics.rpe1_median_deg, drift_deg, 1e-10);
  EXPECT_NEAR(metrics.rpen_deg, drift_deg * n / 2.0, 1e-9);  // mean of d drift over d = 1 .. n - 1
  // Chords of a 1 deg arc of 1 m: the path is shorter than 300 m, so 100 m take 101 steps.
  EXPECT_NEAR(metrics.path_length_m,
              (n - 1) * 2.0 * (180.0 / std::numbers::pi) * std::sin(0.5 * kRadFromDeg),
              1e-9);
  const double expected_100 = drift_deg * 101;
  const double expected_200 = drift_deg * 201 / 2.0;
  EXPECT_NEAR(
      metrics.r_err_deg_per_100m.value(), (20 * expected_100 + 10 * expected_200) / 30.0, 1e-9);
  EXPECT_LT(metrics.ate_m.value(), 1e-10);
}

TEST(Metrics, TakeQuantilesBetweenSamples) {
  // Step errors 1, 2, 3, 4, 5 deg in another order.
  Trajectory truth = Circle(6);
  Trajectory estimate = truth;
  double total_deg = 0.0;
  const double steps_deg[] = {3, 1, 5, 2, 4};
  for (int k = 1; k < 6; ++k) {
    total_deg += steps_deg[k - 1];
    estimate[k].world_from_cam =
        Rotation::Exp(total_deg * kRadFromDeg * kAxis) * truth[k].world_from_cam;
  }
  const TrajectoryMetrics metrics = Compare(truth, estimate);
  EXPECT_NEAR(metrics.rpe1_deg, std::sqrt(11.0), 1e-10);
  EXPECT_NEAR(metrics.rpe1_median_deg, 3.0, 1e-10);
  EXPECT_NEAR(metrics.rpe1_p90_deg, 4.6, 1e-10);
  EXPECT_NEAR(metrics.rpe1_max_deg, 5.0, 1e-10);
  EXPECT_FALSE(metrics.r_err_deg_per_100m.has_value());
}

TEST(Metrics, MeasureTheAteOfAKnownError) {
  // A square with its corners lifted and lowered in turn: no similarity takes that out, and by
  // symmetry the best one is the identity shrunk by nothing but the lift's own spread.
  Trajectory truth;
  Trajectory estimate;
  for (int k = 0; k < 4; ++k) {
    const double x = k == 0 || k == 3 ? 1.0 : -1.0;
    const double y = k < 2 ? 1.0 : -1.0;
    truth.push_back({1.0 * k, {}, Eigen::Vector3d(x, y, 0.0)});
    estimate.push_back({1.0 * k, {}, Eigen::Vector3d(x, y, k % 2 == 0 ? 0.1 : -0.1)});
  }
  const TrajectoryMetrics metrics = Compare(truth, estimate);
  const double scale = 2.0 / 2.01;
  EXPECT_NEAR(metrics.scale.value(), scale, 1e-12);
  EXPECT_NEAR(metrics.ate_m.value(), std::sqrt(2.0 - scale * 2.0), 1e-12);
}

// A mirror image is no similarity: the best one collapses what the mirror swapped.
TEST(Metrics, DoNotMirrorTheEstimate) {
  Trajectory truth;
  Trajectory mirrored;
  for (int k = 0; k < 8; ++k) {
    const Eigen::Vector3d corner(k & 1 ? 3.0 : -3.0, k & 2 ? 2.0 : -2.0, k & 4 ? 1.0 : -1.0);
    truth.push_back({1.0 * k, {}, corner + Eigen::Vector3d(k == 7, 0.0, 0.0)});
    mirrored.push_back(truth.back());
    mirrored.back().center_in_world.y() *= -1.0;
  }
  EXPECT_GT(Compare(truth, mirrored).ate_m.value(), 1.0);
}

TEST(Metrics, HaveNoAteWithoutMotion) {
  Trajectory still = Circle(5);
  for (StampedPose& pose : still) pose.center_in_world.setConstant(3.0);
  EXPECT_FALSE(Compare(Circle(5), still).ate_m.has_value());
  EXPECT_FALSE(Compare(still, Circle(5)).ate_m.has_value());
}

TEST(Metrics, DoNotDependOnThreads) {
  std::mt19937 generator(1);
  std::normal_distribution<double> noise(0.0, 0.01);
  const Trajectory truth = Circle(100);
  Trajectory estimate = truth;
  for (StampedPose& pose : estimate) {
    pose.world_from_cam =
        Rotation::Exp({noise(generator), noise(generator), noise(generator)}) * pose.world_from_cam;
  }
  const auto pairs = AssociatePoses(truth, estimate, {});
  EXPECT_EQ(ComputeMetrics(pairs, {.num_threads = 1}).rpen_deg,
            ComputeMetrics(pairs, {.num_threads = 4}).rpen_deg);
}

TEST(AssociatePoses, InterpolatesBetweenNeighboursOnly) {
  Trajectory truth = Circle(4);  // 0, 0.1, 0.2, 0.3 s
  truth[3].timestamp_s = 0.7;    // a gap of 0.5 s
  const Rotation identity;
  const Trajectory estimate = {
      {-0.05, identity, Eigen::Vector3d::Zero()},     // before the first
      {-0.00005, identity, Eigen::Vector3d::Zero()},  // within exact_s of the first
      {0.025, identity, Eigen::Vector3d::Zero()},     // a quarter of the way
      {0.2, identity, Eigen::Vector3d::Zero()},       // exactly there
      {0.4, identity, Eigen::Vector3d::Zero()},       // in the gap
      {0.70009, identity, Eigen::Vector3d::Zero()},   // within exact_s of the last
      {0.8, identity, Eigen::Vector3d::Zero()}};      // after the last
  const std::vector<PosePair> pairs = AssociatePoses(truth, estimate, {});
  ASSERT_EQ(pairs.size(), 4u);
  EXPECT_EQ(pairs[0].ground_truth.center_in_world, truth[0].center_in_world);
  EXPECT_NEAR(pairs[1].ground_truth.world_from_cam.AngleDeg(), 0.25, 1e-10);
  EXPECT_LT((pairs[1].ground_truth.center_in_world -
             (0.75 * truth[0].center_in_world + 0.25 * truth[1].center_in_world))
                .norm(),
            1e-12);
  EXPECT_NEAR(pairs[2].ground_truth.world_from_cam.AngleDeg(), 2.0, 1e-10);
  EXPECT_NEAR(pairs[3].ground_truth.world_from_cam.AngleDeg(), 3.0, 1e-10);
  EXPECT_EQ(AssociatePoses(truth, estimate, {.max_gap_s = 0.6}).size(), 5u);
}

TEST(Metrics, RefuseTooFewPairsAndBadOptions) {
  EXPECT_THROW(Compare(Circle(2), Circle(2)), std::invalid_argument);
  EXPECT_TRUE(AssociatePoses({}, Circle(2), {}).empty());
  EXPECT_THROW(AssociatePoses(Circle(3), Circle(3), {.max_gap_s = -1.0}), std::invalid_argument);
}

}  // namespace
}  // namespace rotslam
