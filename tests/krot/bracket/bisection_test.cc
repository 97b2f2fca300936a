#include "krot/bracket/bisection.h"

#include <limits>
#include <set>
#include <stdexcept>

#include <gtest/gtest.h>

#include "krot/lp/lp.h"
#include "tests/krot/problem_from_scene.h"

namespace rotslam {
namespace {

// Our interior point and every LP engine of this build.
std::vector<BisectionOptions> AllWays() {
  std::vector<BisectionOptions> ways(1);
  for (const LpEngine engine : {LpEngine::kClp, LpEngine::kGlpk}) {
    if (!HasLpEngine(engine)) continue;
    BisectionOptions options;
    options.method = BisectionMethod::kPrograms;
    options.lp.engine = engine;
    ways.push_back(options);
  }
  return ways;
}

MinimaxProblem NoisyRing(int num_views, int num_points, std::uint64_t seed = 1) {
  SceneOptions options;
  options.num_views = num_views;
  options.num_points = num_points;
  options.noise_px = 1.0;
  options.seed = seed;
  return ProblemFromScene(MakeScene(options));
}

// `b` beside `a`, without a view or point in common.
MinimaxProblem SideBySide(const MinimaxProblem& a, const MinimaxProblem& b) {
  MinimaxProblem both = a;
  both.R_c_w.insert(both.R_c_w.end(), b.R_c_w.begin(), b.R_c_w.end());
  both.num_points += b.num_points;
  for (ImageObservation observation : b.observations) {
    observation.view += a.num_views();
    observation.point += a.num_points;
    both.observations.push_back(observation);
  }
  return both;
}

TEST(MinimiseMaxResidual, ReachesZeroOnACleanScene) {
  SceneOptions options;
  options.num_views = 6;
  options.num_points = 40;
  const MinimaxProblem problem = ProblemFromScene(MakeScene(options));
  for (const BisectionOptions& way : AllWays()) {
    const BisectionResult result = MinimiseMaxResidual(problem, way);
    EXPECT_EQ(result.status, BisectionStatus::kConverged);
    EXPECT_LT(result.gamma_high, 1e-6);
  }
}

TEST(MinimiseMaxResidual, BracketsNarrowlyUnderNoise) {
  for (const double noise_px : {0.1, 0.5, 2.0}) {
    SceneOptions options;
    options.num_views = 8;
    options.num_points = 60;
    options.noise_px = noise_px;
    const MinimaxProblem problem = ProblemFromScene(MakeScene(options));
    double least_high = kInfinity;
    double greatest_low = 0.0;
    for (const BisectionOptions& way : AllWays()) {
      const BisectionResult result = MinimiseMaxResidual(problem, way);
      EXPECT_EQ(result.status, BisectionStatus::kConverged) << noise_px;
      EXPECT_GT(result.gamma_low, 0.99 * result.gamma_high - 1e-12) << noise_px;
      EXPECT_DOUBLE_EQ(result.gamma_high, MaxBoxResidual(problem, result.structure));
      EXPECT_GT(result.gamma_high * 700.0, noise_px);
      EXPECT_LT(result.gamma_high * 700.0, 5.0 * noise_px);
      least_high = std::min(least_high, result.gamma_high);
      greatest_low = std::max(greatest_low, result.gamma_low);
    }
    EXPECT_LE(greatest_low, least_high) << noise_px;  // all bracket the same number
  }
}

TEST(MinimiseMaxResidual, FindsThousandthsOnRequest) {
  for (const std::uint64_t seed : {1, 2, 3}) {
    const MinimaxProblem problem = ProblemFromScene(MakeScene(DrivingOptions(20, 1000, seed)));
    BisectionOptions options;
    options.relative_gap = 1e-3;
    const BisectionResult result = MinimiseMaxResidual(problem, options);
    EXPECT_EQ(result.status, BisectionStatus::kConverged) << seed;
    EXPECT_LE(result.gamma_high - result.gamma_low, 1e-3 * result.gamma_high) << seed;
    EXPECT_LT(result.num_points_in_programs, problem.num_points / 3) << seed;
  }
}

TEST(MinimiseMaxResidual, AgreesWithAllPointsOnADrive) {
  const MinimaxProblem problem = ProblemFromScene(MakeScene(DrivingOptions(12, 150, 4)));
  BisectionOptions programs;
  programs.method = BisectionMethod::kPrograms;
  const BisectionResult few = MinimiseMaxResidual(problem, {});
  const BisectionResult all = MinimiseMaxResidual(problem, programs);
  EXPECT_EQ(few.status, BisectionStatus::kConverged);
  EXPECT_LE(few.gamma_low, all.gamma_high);
  EXPECT_LE(all.gamma_low, few.gamma_high);
}

TEST(MinimiseMaxResidual, NamesTheObservationsThatHoldTheOptimum) {
  const MinimaxProblem problem = NoisyRing(8, 60);
  const BisectionResult result = MinimiseMaxResidual(problem, {});
  ASSERT_FALSE(result.active.empty());
  const std::set<int> active(result.active.begin(), result.active.end());
  for (int o = 0; o < static_cast<int>(problem.observations.size()); ++o) {
    const double residual = BoxResidual(problem, result.structure, problem.observations[o]);
    EXPECT_EQ(active.contains(o), residual >= 0.99 * result.gamma_high);
  }
}

TEST(MinimiseMaxResidual, RepeatsItsDigits) {
  const MinimaxProblem problem = ProblemFromScene(MakeScene(DrivingOptions(20, 400, 2)));
  const BisectionResult a = MinimiseMaxResidual(problem, {});
  const BisectionResult b = MinimiseMaxResidual(problem, {});
  EXPECT_EQ(a.gamma_low, b.gamma_low);
  EXPECT_EQ(a.gamma_high, b.gamma_high);
  EXPECT_EQ(a.structure.center_in_world, b.structure.center_in_world);
}

TEST(MinimiseMaxResidual, HoldsItsGauge) {
  const MinimaxProblem problem = NoisyRing(8, 60);
  for (const BisectionOptions& way : AllWays()) {
    const BisectionResult result = MinimiseMaxResidual(problem, way);
    EXPECT_EQ(result.structure.center_in_world[0], Eigen::Vector3d::Zero());
    double least_depth = kInfinity;
    for (const ImageObservation& observation : problem.observations) {
      least_depth = std::min(least_depth,
                             problem.R_c_w[observation.view].row(2).dot(
                                 result.structure.point_in_world[observation.point] -
                                 result.structure.center_in_world[observation.view]));
    }
    EXPECT_NEAR(least_depth, 1.0, 1e-9);
  }
}

TEST(MinimiseMaxResidual, SolvesEmptyProblemsByAnything) {
  for (const BisectionOptions& way : AllWays()) {
    const BisectionResult nothing = MinimiseMaxResidual({}, way);
    EXPECT_EQ(nothing.status, BisectionStatus::kConverged);
    EXPECT_EQ(nothing.gamma_high, 0.0);

    MinimaxProblem unseen = NoisyRing(3, 5);
    unseen.observations.clear();
    EXPECT_EQ(MinimiseMaxResidual(unseen, way).status, BisectionStatus::kConverged);
  }
}

TEST(MinimiseMaxResidual, PointsSeenOnceFitExactly) {
  const MinimaxProblem problem = NoisyRing(6, 30);
  MinimaxProblem more = problem;
  for (int view = 0; view < 6; ++view) {
    more.observations.push_back({view, more.num_points++, Eigen::Vector2d(0.1 * view, -0.2)});
  }
  for (const BisectionOptions& way : AllWays()) {
    const BisectionResult without = MinimiseMaxResidual(problem, way);
    const BisectionResult with = MinimiseMaxResidual(more, way);
    EXPECT_EQ(with.status, BisectionStatus::kConverged);
    EXPECT_DOUBLE_EQ(with.gamma_high, without.gamma_high);
    EXPECT_DOUBLE_EQ(with.gamma_high, MaxBoxResidual(more, with.structure));
  }
}

TEST(MinimiseMaxResidual, DuplicatesBoundTheOptimumByHalfTheirDistance) {
  MinimaxProblem problem = NoisyRing(6, 30);
  ImageObservation duplicate = problem.observations[7];
  duplicate.xy.x() += 0.2;
  problem.observations.push_back(duplicate);
  for (const BisectionOptions& way : AllWays()) {
    const BisectionResult result = MinimiseMaxResidual(problem, way);
    EXPECT_EQ(result.status, BisectionStatus::kConverged);
    EXPECT_GE(result.gamma_high, 0.1 - 1e-9);
  }
}

TEST(MinimiseMaxResidual, DuplicatesOfASingleViewAreSolvedPointByPoint) {
  MinimaxProblem problem;
  problem.R_c_w = {Eigen::Matrix3d::Identity()};
  problem.num_points = 2;
  problem.observations = {{0, 0, {0.1, 0.0}}, {0, 0, {0.3, 0.0}}, {0, 1, {0.0, 0.5}}};
  for (const BisectionOptions& way : AllWays()) {
    const BisectionResult result = MinimiseMaxResidual(problem, way);
    EXPECT_EQ(result.status, BisectionStatus::kConverged);
    EXPECT_NEAR(result.gamma_high, 0.1, 1e-12);
    EXPECT_NEAR(result.gamma_low, 0.1, 1e-12);
    EXPECT_LE(result.gamma_low, 0.1);
  }
}

TEST(MinimiseMaxResidual, DisconnectedPartsAreSolvedApart) {
  const MinimaxProblem a = NoisyRing(6, 40, 1);
  const MinimaxProblem b = NoisyRing(5, 30, 2);
  const MinimaxProblem both = SideBySide(a, b);
  for (const BisectionOptions& way : AllWays()) {
    const BisectionResult of_a = MinimiseMaxResidual(a, way);
    const BisectionResult of_b = MinimiseMaxResidual(b, way);
    const BisectionResult of_both = MinimiseMaxResidual(both, way);
    EXPECT_EQ(of_both.status, BisectionStatus::kConverged);
    EXPECT_LE(of_both.gamma_low, std::max(of_a.gamma_high, of_b.gamma_high));
    EXPECT_GE(of_both.gamma_high, std::max(of_a.gamma_low, of_b.gamma_low));
    EXPECT_LE(of_both.gamma_high - of_both.gamma_low, 0.01 * of_both.gamma_high);
  }
}

TEST(MinimiseMaxResidual, AViewWithoutObservationsIsLeftAtTheOrigin) {
  MinimaxProblem problem = NoisyRing(6, 40);
  problem.R_c_w.push_back(Eigen::Matrix3d::Identity());
  for (const BisectionOptions& way : AllWays()) {
    const BisectionResult result = MinimiseMaxResidual(problem, way);
    EXPECT_EQ(result.status, BisectionStatus::kConverged);
    EXPECT_EQ(result.structure.center_in_world.back(), Eigen::Vector3d::Zero());
  }
}

TEST(MinimiseMaxResidual, PointsSeenBehindCamerasWidenTheBoundOnly) {
  // Rays turned round: mirrored sights that nothing in front of the cameras can explain well.
  MinimaxProblem problem = NoisyRing(6, 40);
  for (std::size_t o = 0; o < problem.observations.size(); o += 9) {
    problem.observations[o].xy *= -3.0;
  }
  for (const BisectionOptions& way : AllWays()) {
    const BisectionResult result = MinimiseMaxResidual(problem, way);
    ASSERT_LT(result.gamma_high, kInfinity);
    EXPECT_LE(result.gamma_low, result.gamma_high);
    EXPECT_GT(result.gamma_high, 10.0 / 700.0);
    for (const ImageObservation& observation : problem.observations) {
      EXPECT_LT(BoxResidual(problem, result.structure, observation), kInfinity);
    }
  }
}

TEST(MinimiseMaxResidual, RefusesWhatIsNoProblem) {
  const MinimaxProblem problem = NoisyRing(5, 20);
  MinimaxProblem broken = problem;
  broken.observations[3].xy.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(MinimiseMaxResidual(broken, {}), std::invalid_argument);
  broken = problem;
  broken.observations[3].view = 5;
  EXPECT_THROW(MinimiseMaxResidual(broken, {}), std::invalid_argument);
  broken = problem;
  broken.R_c_w[1](0, 0) = kInfinity;
  EXPECT_THROW(MinimiseMaxResidual(broken, {}), std::invalid_argument);
  BisectionOptions options;
  options.relative_gap = 0.0;
  EXPECT_THROW(MinimiseMaxResidual(problem, options), std::invalid_argument);
  const MinimaxStructure short_start;
  EXPECT_THROW(MinimiseMaxResidual(problem, {}, &short_start), std::invalid_argument);
}

TEST(MinimiseMaxResidual, StopsWhenToldAndHasAStructureAllTheSame) {
  const MinimaxProblem problem = ProblemFromScene(MakeScene(DrivingOptions(20, 400, 3)));
  for (BisectionOptions way : AllWays()) {
    if (way.lp.engine == LpEngine::kGlpk) continue;  // takes seconds per program at this size
    int num_calls = 0;
    double last_high = kInfinity;
    way.on_progress = [&](const BisectionProgress& progress) {
      EXPECT_LE(progress.gamma_high, last_high);
      EXPECT_LE(progress.gamma_low, progress.gamma_high);
      last_high = progress.gamma_high;
      return ++num_calls < 3;
    };
    const BisectionResult result = MinimiseMaxResidual(problem, way);
    EXPECT_EQ(result.status, BisectionStatus::kCancelled);
    EXPECT_EQ(num_calls, 3);
    EXPECT_LT(result.gamma_high, kInfinity);
    EXPECT_DOUBLE_EQ(result.gamma_high, MaxBoxResidual(problem, result.structure));
  }
}

TEST(MinimiseMaxResidual, IsNeverWorseThanItsStart) {
  const Scene scene = MakeScene(DrivingOptions(20, 400, 5));
  const MinimaxProblem problem = ProblemFromScene(scene);
  MinimaxStructure start;
  for (const auto& [frame, center] : scene.true_center_in_world) {
    start.center_in_world.push_back(center);
  }
  for (const Track& track : scene.tracks) {
    start.point_in_world.push_back(scene.true_point_in_world.at(track.id));
  }
  const double before = MaxBoxResidual(problem, start);
  ASSERT_LT(before, kInfinity);
  for (BisectionOptions way : AllWays()) {
    if (way.lp.engine == LpEngine::kGlpk) continue;
    way.max_programs = 1;
    EXPECT_LE(MinimiseMaxResidual(problem, way, &start).gamma_high, before * (1.0 + 1e-12));
  }
}

TEST(MinimiseMaxResidual, AStartThatIsNoStructureDoesNoHarm) {
  const MinimaxProblem problem = NoisyRing(6, 40);
  MinimaxStructure start;
  start.center_in_world.assign(problem.num_views(), Eigen::Vector3d::Zero());
  start.point_in_world.assign(problem.num_points, Eigen::Vector3d::Zero());
  for (const bool finite : {true, false}) {
    if (!finite) start.center_in_world[2].x() = std::numeric_limits<double>::quiet_NaN();
    if (!finite) start.point_in_world[3].y() = std::numeric_limits<double>::quiet_NaN();
    for (const BisectionOptions& way : AllWays()) {
      EXPECT_EQ(MinimiseMaxResidual(problem, way, &start).status, BisectionStatus::kConverged);
    }
  }
}

TEST(Scenes, DriveAndOrbitHaveTheirSights) {
  const Scene drive = MakeScene(DrivingOptions(50, 2000, 1));
  std::size_t sights = 0;
  for (const Track& track : drive.tracks) sights += track.observations.size();
  EXPECT_NEAR(static_cast<double>(sights) / static_cast<double>(drive.tracks.size()), 6.4, 0.3);

  const Scene orbit = MakeScene(DenseOrbitOptions(1));
  EXPECT_EQ(orbit.tracks.size(), 14828u);
  sights = 0;
  std::set<std::pair<FrameId, FrameId>> pairs;
  for (const Track& track : orbit.tracks) {
    sights += track.observations.size();
    for (const Observation& a : track.observations) {
      for (const Observation& b : track.observations) {
        if (a.frame < b.frame) pairs.emplace(a.frame, b.frame);
      }
    }
  }
  EXPECT_NEAR(static_cast<double>(sights) / 14828.0, 11.4, 0.3);
  EXPECT_EQ(pairs.size(), 172u * 171u / 2u);
}

}  // namespace
}  // namespace rotslam
