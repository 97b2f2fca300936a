#include "krot/structure/structure_system.h"

#include <Eigen/Dense>
#include <gtest/gtest.h>

#include "krot/structure/camera_system.h"
#include "tests/krot/problem_from_scene.h"

namespace rotslam {
namespace {

Eigen::Matrix3d RandomPositive(SceneRandom& random) {
  Eigen::Matrix3d root;
  for (double& entry : root.reshaped()) entry = random.Normal(1.0);
  return root * root.transpose();
}

// H where everything moves; what is held has the identity, and nothing in common with the rest.
Eigen::MatrixXd Dense(const MinimaxProblem& problem, const std::vector<Eigen::Matrix3d>& S) {
  const StructureLayout layout{problem.num_views(), problem.num_points};
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(layout.size(), layout.size());
  for (std::size_t o = 0; o < S.size(); ++o) {
    const int point = layout.Point(problem.observations[o].point);
    H.block<3, 3>(point, point) += S[o];
    if (problem.observations[o].view == 0) continue;
    const int center = layout.Center(problem.observations[o].view);
    H.block<3, 3>(center, center) += S[o];
    H.block<3, 3>(center, point) -= S[o];
    H.block<3, 3>(point, center) -= S[o];
  }
  const auto hold = [&](int first) {
    H.middleRows<3>(first).setZero();
    H.middleCols<3>(first).setZero();
    H.block<3, 3>(first, first).setIdentity();
  };
  for (int view = 1; view < problem.num_views(); ++view) {
    if (problem.ViewFixed(view)) hold(layout.Center(view));
  }
  for (int point = 0; point < problem.num_points; ++point) {
    if (problem.PointFixed(point)) hold(layout.Point(point));
  }
  return H;
}

void ExpectSameAsDense(const MinimaxProblem& problem) {
  SceneRandom random(3);
  std::vector<Eigen::Matrix3d> S;
  for (std::size_t o = 0; o < problem.observations.size(); ++o) S.push_back(RandomPositive(random));
  StructureSystem system(problem);
  ASSERT_TRUE(system.Factor(S));
  const Eigen::MatrixXd H = Dense(problem, S);
  Eigen::VectorXd b(H.rows());
  for (double& entry : b) entry = random.Normal(1.0);
  const StructureLayout layout{problem.num_views(), problem.num_points};
  Eigen::VectorXd pushed = b;  // also what is held, which must not move for it
  for (int view = 1; view < problem.num_views(); ++view) {
    if (problem.ViewFixed(view)) b.segment<3>(layout.Center(view)).setZero();
  }
  for (int point = 0; point < problem.num_points; ++point) {
    if (problem.PointFixed(point)) b.segment<3>(layout.Point(point)).setZero();
  }
  const Eigen::VectorXd expected = H.ldlt().solve(b);
  EXPECT_LT((system.Solve(S, pushed) - expected).norm(), 1e-9 * expected.norm());
}

TEST(StructureSystem, SolvesAsTheDenseSystemDoes) {
  SceneOptions ring;
  ring.num_views = 20;
  ring.num_points = 60;
  ring.max_track_length = 5;
  ExpectSameAsDense(ProblemFromScene(MakeScene(ring)));
  ExpectSameAsDense(ProblemFromScene(MakeScene(DrivingOptions(40, 200, 1))));
}

TEST(StructureSystem, LeavesWhatIsHeldWhereItIs) {
  SceneOptions ring;
  ring.num_views = 12;
  ring.num_points = 40;
  ring.max_track_length = 5;
  MinimaxProblem problem = ProblemFromScene(MakeScene(ring));
  problem.view_fixed.assign(problem.num_views(), false);
  problem.point_fixed.assign(problem.num_points, false);
  for (const int view : {3, 4, 11}) problem.view_fixed[view] = true;
  for (const int point : {0, 7, 39}) problem.point_fixed[point] = true;
  ExpectSameAsDense(problem);
}

TEST(StructureSystem, CountsBothOfTwoSightsFromOneView) {
  SceneOptions ring;
  ring.num_views = 4;
  ring.num_points = 10;
  MinimaxProblem problem = ProblemFromScene(MakeScene(ring));
  problem.observations.push_back(problem.observations[5]);
  problem.observations.push_back(problem.observations[0]);
  ExpectSameAsDense(problem);
}

TEST(CameraSystem, FillsInWhereEliminationDoes) {
  // A closed chain of 100 blocks, shuffled, with two chords: fill appears in any order.
  SceneRandom random(4);
  constexpr int kBlocks = 100;
  std::vector<std::vector<int>> groups;
  for (int k = 0; k < kBlocks; ++k) groups.push_back({(37 * k) % kBlocks, 37 * (k + 1) % kBlocks});
  groups.push_back({3, 77});
  groups.push_back({10, 55, 90});
  CameraSystem system(kBlocks, groups);
  system.SetZero();
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(3 * kBlocks, 3 * kBlocks);
  for (const std::vector<int>& group : groups) {
    for (const int a : group) {
      const Eigen::Matrix3d diagonal = RandomPositive(random) + 20.0 * Eigen::Matrix3d::Identity();
      system.Add(a, a, diagonal);
      H.block<3, 3>(3 * a, 3 * a) += diagonal;
      for (const int b : group) {
        if (b >= a) continue;
        const Eigen::Matrix3d block = RandomPositive(random);
        system.Add(a, b, block);
        H.block<3, 3>(3 * a, 3 * b) += block;
        H.block<3, 3>(3 * b, 3 * a) += block.transpose();
      }
    }
  }
  ASSERT_TRUE(system.Factor());
  Eigen::VectorXd b(3 * kBlocks);
  for (double& entry : b) entry = random.Normal(1.0);
  EXPECT_LT((H * system.Solve(b) - b).norm(), 1e-10 * b.norm());
}

TEST(CameraSystem, SaysNoToAnIndefiniteMatrix) {
  CameraSystem system(2, {{0, 1}});
  system.SetZero();
  system.Add(0, 0, Eigen::Matrix3d::Identity());
  system.Add(1, 1, Eigen::Matrix3d::Identity());
  system.Add(1, 0, 2.0 * Eigen::Matrix3d::Identity());
  EXPECT_FALSE(system.Factor());
}

}  // namespace
}  // namespace rotslam
