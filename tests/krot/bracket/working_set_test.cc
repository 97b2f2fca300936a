#include "krot/bracket/working_set.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "tests/krot/problem_from_scene.h"

namespace rotslam {
namespace {

TEST(ConnectedParts, NamesViewsAndPointsOfEachPart) {
  // Views 0 and 2 share points 1 and 3, views 1 and 3 share point 0; point 2 is seen once, view 4
  // sees nothing else.
  MinimaxProblem problem;
  problem.R_c_w.assign(5, Eigen::Matrix3d::Identity());
  problem.num_points = 4;
  for (const auto& [view, point] :
       std::vector<std::pair<int, int>>{{1, 0}, {3, 0}, {0, 1}, {2, 1}, {4, 2}, {2, 3}, {0, 3}}) {
    problem.observations.push_back({view, point, Eigen::Vector2d::Zero()});
  }
  const std::vector<SubProblem> parts = ConnectedParts(problem);
  ASSERT_EQ(parts.size(), 2u);
  EXPECT_EQ(parts[0].views, (std::vector<int>{0, 2}));
  EXPECT_EQ(parts[0].points, (std::vector<int>{1, 3}));
  EXPECT_EQ(parts[0].problem.observations.size(), 4u);
  EXPECT_EQ(parts[1].views, (std::vector<int>{1, 3}));
  EXPECT_EQ(parts[1].points, (std::vector<int>{0}));
}

TEST(SpreadPoints, CoversEveryViewWithFewPointsInOnePart) {
  const MinimaxProblem problem = ProblemFromScene(MakeScene(DrivingOptions(50, 5000, 1)));
  const std::vector<bool> chosen = SpreadPoints(problem, 8);
  const auto num_chosen = std::count(chosen.begin(), chosen.end(), true);
  EXPECT_LT(num_chosen, problem.num_points / 10);
  std::vector<int> count(problem.num_views(), 0);
  for (const ImageObservation& observation : problem.observations) {
    count[observation.view] += chosen[observation.point];
  }
  EXPECT_GE(*std::min_element(count.begin(), count.end()), 8);
  EXPECT_EQ(ConnectedParts(RestrictToPoints(problem, chosen).problem).size(), 1u);
}

TEST(AddWorstPoints, TakesTheWorstOfEveryView) {
  MinimaxProblem problem;
  problem.R_c_w.assign(3, Eigen::Matrix3d::Identity());
  problem.num_points = 5;
  for (const auto& [view, point] :
       std::vector<std::pair<int, int>>{{0, 0}, {0, 1}, {0, 2}, {1, 2}, {1, 3}, {2, 4}}) {
    problem.observations.push_back({view, point, Eigen::Vector2d::Zero()});
  }
  std::vector<bool> chosen(5, false);
  EXPECT_EQ(AddWorstPoints(problem, {3.0, 5.0, 4.0, 1.5, 0.5}, 1.0, 1, chosen), 2);
  EXPECT_EQ(chosen, (std::vector<bool>{false, true, true, false, false}));
  EXPECT_EQ(AddWorstPoints(problem, {3.0, 5.0, 4.0, 1.5, 0.5}, 1.0, 1, chosen), 2);
  EXPECT_EQ(chosen, (std::vector<bool>{true, true, true, true, false}));
}

}  // namespace
}  // namespace rotslam
