#include "rotodom/averaging/closure.h"

#include <gtest/gtest.h>

#include "tests/scenes/rotation_graph.h"

namespace rotslam {
namespace {

ViewGraph GraphWith(double wrong_ratio, double variance, std::uint64_t seed = 1) {
  const RotationGraph made = MakeRotationGraph({.wrong_ratio = wrong_ratio, .seed = seed});
  ViewGraph graph;
  for (RelativeRotation edge : made.graph.edges()) {
    edge.covariance /= variance;
    graph.AddEdge(edge);
  }
  return graph;
}

TEST(ClosureVariance, IsOneWhereEdgesAreAsGoodAsTheySay) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    EXPECT_NEAR(ClosureVariance(GraphWith(0.0, 1.0, seed)), 1.2, 0.15) << seed;
  }
}

TEST(ClosureVariance, GrowsWithTheErrors) {
  EXPECT_NEAR(
      ClosureVariance(GraphWith(0.0, 100.0)) / ClosureVariance(GraphWith(0.0, 4.0)), 25.0, 1e-6);
}

TEST(ClosureVariance, AFewWrongEdgesDoNotCountManyDo) {
  // An edge has part in some six triangles of two for each edge.
  const double without = ClosureVariance(GraphWith(0.0, 4.0));
  EXPECT_NEAR(ClosureVariance(GraphWith(0.01, 4.0)), without, 0.2 * without);
  EXPECT_GT(ClosureVariance(GraphWith(0.2, 4.0)), 10.0 * without);
}

TEST(ClosureVariance, NeedsTriangles) {
  const RotationGraph chain = MakeRotationGraph({.reach = 1});
  EXPECT_EQ(ClosureVariance(chain.graph), 1.0);
  EXPECT_EQ(ClosureVariance(ViewGraph()), 1.0);
}

}  // namespace
}  // namespace rotslam
