#include "krot/interior_point/minimax_interior.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include <gtest/gtest.h>

#include "krot/structure/minimax_lp.h"
#include "tests/krot/problem_from_scene.h"

namespace rotslam {
namespace {

constexpr double kCertificateExtent =
    1e6;  // structures that certificates exclude, in smallest depths

struct RingProblem {
  explicit RingProblem(double noise_px) {
    SceneOptions options;
    options.num_views = 8;
    options.num_points = 60;
    options.noise_px = noise_px;
    const Scene scene = MakeScene(options);
    problem = ProblemFromScene(scene);
    // The first centre is the origin.
    const Eigen::Vector3d origin = scene.true_center_in_world.begin()->second;
    for (const auto& [frame, center] : scene.true_center_in_world) {
      truth.center_in_world.push_back(center - origin);
    }
    for (const Track& track : scene.tracks) {
      truth.point_in_world.push_back(scene.true_point_in_world.at(track.id) - origin);
    }
  }

  // The truth, its points up to a tenth of their depth off.
  MinimaxStructure Perturbed() const {
    MinimaxStructure structure = truth;
    SceneRandom random(7);
    for (Eigen::Vector3d& point : structure.point_in_world) point += random.NormalVector(0.2);
    return structure;
  }

  MinimaxProblem problem;
  MinimaxStructure truth;
};

// The least largest residual by the LP engine: halves a bracket.
double OptimumByLp(const MinimaxProblem& problem, double low, double high) {
  while (high - low > 2e-3 * high) {
    const double middle = 0.5 * (low + high);
    const MinimaxLpResult result = SolveFeasibility(problem, middle);
    if (MaxBoxResidual(problem, result.structure) <= middle * (1.0 + 1e-6)) {
      high = middle;
    } else {
      low = middle;
    }
  }
  return high;
}

TEST(MinimaxInterior, GetsInsideTheHalfSpacesWhereThatIsPossible) {
  const RingProblem ring(0.5);
  const double gamma = 1.5 * MaxBoxResidual(ring.problem, ring.truth);
  InteriorOptions options;
  options.stop_when_feasible = true;
  const MinimaxStructure start = ring.Perturbed();
  ASSERT_GT(MaxBoxResidual(ring.problem, start), 10.0 * gamma);
  const InteriorResult result = MinimaxInterior(ring.problem).Solve(gamma, start, options);
  EXPECT_TRUE(result.converged);
  EXPECT_LT(result.slack, 0.0);
  EXPECT_LE(MaxBoxResidual(ring.problem, result.structure), gamma);
  EXPECT_EQ(result.structure.center_in_world.front(), Eigen::Vector3d::Zero());
}

TEST(MinimaxInterior, ProvesThatABoundIsTooSmall) {
  const RingProblem ring(0.5);
  const double gamma = 0.3 / 700.0;
  const InteriorResult result = MinimaxInterior(ring.problem).Solve(gamma, ring.truth, {});
  EXPECT_TRUE(result.converged);
  EXPECT_GT(result.slack, 0.0);
  EXPECT_GT(result.slack_bound, 0.0);
  EXPECT_TRUE(CertifiesInfeasible(ring.problem, gamma, result.multipliers, kCertificateExtent));
  for (const double price : result.multipliers) EXPECT_GE(price, 0.0);
}

TEST(MinimaxInterior, ClosesTheGapBetweenItsBounds) {
  const RingProblem ring(1.0);
  InteriorOptions options;
  options.tolerance = 1e-5;
  const double gamma = MaxBoxResidual(ring.problem, ring.truth);
  const InteriorResult result = MinimaxInterior(ring.problem).Solve(gamma, ring.truth, options);
  ASSERT_TRUE(result.converged);
  EXPECT_LE(result.slack_bound, result.slack + 1e-9);
  EXPECT_LE(result.slack - result.slack_bound, 0.11 * std::abs(result.slack));
  EXPECT_LT(result.iterations, 40);
}

// From the residual of the truth two steps lead to what the LP engine finds by halving.
TEST(MinimaxInterior, IsAStepTowardsTheOptimum) {
  const RingProblem ring(1.0);
  const double start = MaxBoxResidual(ring.problem, ring.truth);
  const double optimum = OptimumByLp(ring.problem, 0.1 * start, start);
  MinimaxInterior interior(ring.problem);
  InteriorOptions options;
  options.tolerance = 1e-5;
  MinimaxStructure structure = ring.truth;
  double gamma = start;
  for (int step = 0; step < 4; ++step) {
    const InteriorResult result = interior.Solve(gamma, structure, options);
    const double residual = MaxBoxResidual(ring.problem, result.structure);
    EXPECT_LE(residual, gamma * (1.0 + 1e-4)) << step;
    structure = result.structure;
    gamma = residual;
  }
  EXPECT_NEAR(gamma, optimum, 0.01 * optimum);
}

// Depths over those of the reference.
std::vector<double> DepthRatios(const RingProblem& ring, const MinimaxStructure& structure) {
  const auto depth = [&](const MinimaxStructure& one, const ImageObservation& observation) {
    return ring.problem.R_c_w[observation.view].row(2).dot(one.point_in_world[observation.point] -
                                                           one.center_in_world[observation.view]);
  };
  std::vector<double> ratios;
  for (const ImageObservation& observation : ring.problem.observations) {
    ratios.push_back(depth(structure, observation) / depth(ring.truth, observation));
  }
  return ratios;
}

TEST(MinimaxInterior, KeepsTheMeanDepthOfItsReferenceAndItsFloor) {
  const RingProblem ring(4.0);
  const double gamma = MaxBoxResidual(ring.problem, ring.truth);
  MinimaxInterior interior(ring.problem);
  InteriorOptions options;
  options.depth_floor = 0.995;
  const auto ratios = DepthRatios(ring, interior.Solve(gamma, ring.truth, options).structure);
  const double sum = std::accumulate(ratios.begin(), ratios.end(), 0.0);
  EXPECT_NEAR(sum / static_cast<double>(ratios.size()), 1.0, 1e-6);
  EXPECT_GT(*std::min_element(ratios.begin(), ratios.end()), options.depth_floor - 1e-9);
  options.depth_floor = 0.1;
  const auto free = DepthRatios(ring, interior.Solve(gamma, ring.truth, options).structure);
  EXPECT_LT(*std::min_element(free.begin(), free.end()), 0.995);
}

TEST(MinimaxInterior, FindsAStructureWithoutAReference) {
  const RingProblem ring(0.5);
  const double gamma = MaxBoxResidual(ring.problem, ring.truth);
  const InteriorResult result = MinimaxInterior(ring.problem).FindFeasible(gamma, {});
  EXPECT_TRUE(result.converged);
  EXPECT_LE(MaxBoxResidual(ring.problem, result.structure), 2.0 * gamma);
}

TEST(MinimaxInterior, FindsNoneWhereThereIsNone) {
  const RingProblem ring(2.0);
  const double gamma = 0.05 / 700.0;
  const InteriorResult result = MinimaxInterior(ring.problem).FindFeasible(gamma, {});
  EXPECT_FALSE(result.converged);
}

TEST(MinimaxInterior, HoldsWhatIsFixed) {
  RingProblem ring(0.5);
  ring.problem.view_fixed.assign(ring.problem.num_views(), false);
  ring.problem.view_fixed[3] = true;
  ring.problem.point_fixed.assign(ring.problem.num_points, false);
  ring.problem.point_fixed[5] = true;
  const double gamma = MaxBoxResidual(ring.problem, ring.truth);
  const InteriorResult result = MinimaxInterior(ring.problem).Solve(gamma, ring.truth, {});
  // The mean depth takes the scale, and that of the truth is one already.
  EXPECT_LT((result.structure.center_in_world[3] - ring.truth.center_in_world[3]).norm(), 1e-9);
  EXPECT_LT((result.structure.point_in_world[5] - ring.truth.point_in_world[5]).norm(), 1e-9);
  EXPECT_GT((result.structure.center_in_world[4] - ring.truth.center_in_world[4]).norm(), 1e-6);
}

}  // namespace
}  // namespace rotslam
