#include "apps/slam/map/odometry_agreement.h"

#include <cmath>

#include <gtest/gtest.h>

namespace rotslam {
namespace {

// A turn of `angle_deg` that is known to `sigma_deg`.
OrientationInMap TurnedBy(double angle_deg, double sigma_deg) {
  const double sigma_rad = sigma_deg * kRadFromDeg;
  return {Rotation::Exp({0.0, angle_deg * kRadFromDeg, 0.0}),
          sigma_rad * sigma_rad * Eigen::Matrix3d::Identity()};
}

TEST(DepartureOf, CountsTheDeviationsOfBoth) {
  AveragingOptions options;
  options.edge_error_factor = 1.0;
  options.edge_floor_deg = 0.0;
  RelativeRotation edge{FrameId{0}, FrameId{1}, TurnedBy(0.5, 0.0).cam_from_world};
  edge.covariance = TurnedBy(0.0, 0.02).covariance;
  const auto departure = [&](double angle_deg, double sigma_deg) {
    return DepartureOf(edge, TurnedBy(1.0, 0.0), TurnedBy(angle_deg, sigma_deg), options);
  };
  EXPECT_NEAR(departure(4.0, 0.02).angle_deg, 2.5, 1e-9);
  EXPECT_NEAR(departure(4.0, 0.02).sigmas, 2.5 / (0.02 * std::sqrt(2.0)), 1e-6);
  EXPECT_TRUE(departure(4.0, 0.02).IsTooFar());
  EXPECT_FALSE(departure(1.7, 0.02).IsTooFar()) << "0.2 deg";
  EXPECT_FALSE(departure(4.0, 1.0).IsTooFar()) << "the points leave the orientation open";
}

TEST(DepartingSteps, FindsTheKeyframeThatFlips) {
  ViewGraph graph;
  RotationMap odometry;
  RotationMap refined;
  std::set<FrameId> keyframes;
  for (int n = 0; n <= 40; ++n) {
    odometry[FrameId{n}] = Rotation::Exp({0.0, 0.01 * n, 0.0});
    if (n > 0) {
      RelativeRotation edge{
          FrameId{n - 1}, FrameId{n}, odometry[FrameId{n}] * odometry[FrameId{n - 1}].Inverse()};
      edge.covariance = 1e-8 * Eigen::Matrix3d::Identity();
      graph.AddEdge(edge);
    }
    if (n % 5 != 0) continue;
    keyframes.insert(FrameId{n});
    const double flip_rad = n == 15 ? 3.0 * kRadFromDeg : 0.0;
    refined[FrameId{n}] = Rotation::Exp({flip_rad, 0.0, 0.0}) * odometry[FrameId{n}];
  }
  const std::vector<DepartingStep> steps =
      DepartingSteps(graph, odometry, refined, {keyframes}, AveragingOptions());
  ASSERT_EQ(steps.size(), 2U) << "into the flip, and out of it";
  EXPECT_EQ(steps[0].first, FrameId{10});
  EXPECT_EQ(steps[0].last, FrameId{15});
  EXPECT_EQ(steps[1].last, FrameId{20});
  EXPECT_NEAR(steps[0].departure.angle_deg, 3.0, 1e-6);
  refined[FrameId{15}] = odometry[FrameId{15}];
  EXPECT_TRUE(DepartingSteps(graph, odometry, refined, {keyframes}, AveragingOptions()).empty());
}

}  // namespace
}  // namespace rotslam
