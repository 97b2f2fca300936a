#include "krot/interior_point/minimax_point.h"

#include <gtest/gtest.h>

#include "tests/scenes/scene.h"

namespace rotslam {
namespace {

// Sights of every track of a scene from its true centres, with the centre's share of a track's
// problem left out.
struct PointScene {
  std::vector<std::vector<AffineProjection>> projections;
  std::vector<Eigen::Vector3d> truth;
};

PointScene SightsOfPoints(const SceneOptions& options) {
  const Scene scene = MakeScene(options);
  PointScene points;
  for (const Track& track : scene.tracks) {
    std::vector<AffineProjection> projections;
    for (const Observation& observation : track.observations) {
      projections.push_back(
          ProjectionOfPoint(scene.cam_from_world.at(observation.frame).Matrix(),
                            scene.true_center_in_world.at(observation.frame),
                            observation.bearing.head<2>() / observation.bearing.z()));
    }
    points.projections.push_back(std::move(projections));
    points.truth.push_back(scene.true_point_in_world.at(track.id));
  }
  return points;
}

// The projection of a known point into a view of unknown centre.
AffineProjection ProjectionFromCenter(const Eigen::Matrix3d& R_c_w,
                                      const Eigen::Vector3d& point_in_world,
                                      const Eigen::Vector2d& xy) {
  const AffineProjection projection = ProjectionOfPoint(R_c_w, point_in_world, xy);
  return {-projection.A, -projection.b};
}

std::vector<std::vector<AffineProjection>> ProjectionsFromCenters(const Scene& scene) {
  std::map<FrameId, std::vector<AffineProjection>> projections;
  for (const Track& track : scene.tracks) {
    for (const Observation& observation : track.observations) {
      projections[observation.frame].push_back(
          ProjectionFromCenter(scene.cam_from_world.at(observation.frame).Matrix(),
                               scene.true_point_in_world.at(track.id),
                               observation.bearing.head<2>() / observation.bearing.z()));
    }
  }
  std::vector<std::vector<AffineProjection>> result;
  for (auto& [frame, of_view] : projections) result.push_back(std::move(of_view));
  return result;
}

SceneOptions Street(double noise_px) {
  SceneOptions options;
  options.num_views = 30;
  options.num_points = 300;
  options.noise_px = noise_px;
  options.path = ScenePath::kStreet;
  return options;
}

TEST(FindMinimaxPoint, TriangulatesExactlyWithoutNoise) {
  const PointScene points = SightsOfPoints(Street(0.0));
  for (std::size_t i = 0; i < points.projections.size(); ++i) {
    const MinimaxPoint point = FindMinimaxPoint(points.projections[i], Eigen::Vector3d::Zero());
    EXPECT_LT(point.gamma_high, 1e-9) << i;
    EXPECT_LE(point.gamma_low, point.gamma_high) << i;
  }
}

TEST(FindMinimaxPoint, BracketsNarrowlyUnderNoiseFromAnyStart) {
  const PointScene points = SightsOfPoints(Street(1.0));
  SceneRandom random(5);
  int num_narrow = 0;
  for (const auto& projections : points.projections) {
    const Eigen::Vector3d far(random.Normal(100.0), random.Normal(100.0), random.Normal(100.0));
    const MinimaxPoint point = FindMinimaxPoint(projections, far);
    ASSERT_LT(point.gamma_high, kInfinity);
    EXPECT_DOUBLE_EQ(point.gamma_high, MaxPointResidual(projections, point.position));
    num_narrow += point.gamma_high - point.gamma_low <= 1e-3 * point.gamma_high;
  }
  EXPECT_GE(num_narrow, 0.99 * static_cast<double>(points.projections.size()));
}

TEST(FindMinimaxPoint, NothingNearbyIsBelowTheLowerBound) {
  const PointScene points = SightsOfPoints(Street(1.0));
  SceneRandom random(6);
  for (std::size_t i = 0; i < points.projections.size(); i += 3) {
    const MinimaxPoint point = FindMinimaxPoint(points.projections[i], points.truth[i]);
    EXPECT_LE(point.gamma_high, MaxPointResidual(points.projections[i], points.truth[i]));
    for (double step = 3.0; step > 1e-4; step *= 0.5) {
      for (int trial = 0; trial < 20; ++trial) {
        const Eigen::Vector3d near =
            point.position +
            Eigen::Vector3d(random.Normal(step), random.Normal(step), random.Normal(step));
        EXPECT_GE(MaxPointResidual(points.projections[i], near), point.gamma_low);
      }
    }
  }
}

TEST(FindMinimaxPoint, ResectsCentres) {
  for (const auto& projections : ProjectionsFromCenters(MakeScene(Street(0.0)))) {
    EXPECT_LT(FindMinimaxPoint(projections, Eigen::Vector3d::Zero()).gamma_high, 1e-8);
  }
  const auto noisy = ProjectionsFromCenters(MakeScene(Street(1.0)));
  int num_narrow = 0;
  for (const auto& projections : noisy) {
    const MinimaxPoint center = FindMinimaxPoint(projections, Eigen::Vector3d::Zero());
    EXPECT_LT(center.gamma_high, 5.0 / 700.0);
    num_narrow += center.gamma_high - center.gamma_low <= 1e-3 * center.gamma_high;
  }
  EXPECT_GE(num_narrow, 0.95 * static_cast<double>(noisy.size()));
}

TEST(FindMinimaxPoint, ParallelRaysMeetFarAway) {
  const std::vector<AffineProjection> projections = {
      ProjectionOfPoint(Eigen::Matrix3d::Identity(), {0, 0, 0}, {0.1, 0.0}),
      ProjectionOfPoint(Eigen::Matrix3d::Identity(), {1, 0, 0}, {0.1, 0.0})};
  const MinimaxPoint point = FindMinimaxPoint(projections, {0, 0, 1});
  EXPECT_LT(point.gamma_high, 1e-3);
  EXPECT_LT(point.gamma_low, 1e-6);  // no point within a million baselines is closer
}

TEST(FindMinimaxPoint, StopsWhereItIsGoodEnough) {
  const PointScene points = SightsOfPoints(Street(1.0));
  MinimaxPointOptions options;
  options.good_enough = 100.0;
  const MinimaxPoint point = FindMinimaxPoint(points.projections[0], points.truth[0], options);
  EXPECT_EQ(point.position, points.truth[0]);
}

}  // namespace
}  // namespace rotslam
