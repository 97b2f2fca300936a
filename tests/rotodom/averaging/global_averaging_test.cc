#include "rotodom/averaging/global_averaging.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <set>
#include <stdexcept>
#include <vector>

#include <gtest/gtest.h>

#include "rotodom/averaging/certificate.h"
#include "tests/scenes/wrong_edges.h"

namespace rotslam {
namespace {

Eigen::Vector3d RandomVector(std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  const double x = normal(random);
  const double y = normal(random);
  return {x, y, normal(random)};
}

RelativeRotation EdgeBetween(int i, int j) {
  RelativeRotation edge;
  edge.i = FrameId{i};
  edge.j = FrameId{j};
  return edge;
}

GlobalAveragingResult Average(const std::vector<RelativeRotation>& edges,
                              const GlobalAveragingOptions& options = {},
                              int num_threads = 2) {
  GlobalAveragingProblem problem;
  problem.edges = edges;
  return AverageGlobally(problem, options, num_threads);
}

GlobalAveragingOptions Exact() {
  GlobalAveragingOptions options;
  options.min_step_deg = 1e-9;
  return options;
}

// Largest difference between turns from each view to the first one.
double MaxDifferenceDeg(const RotationMap& a, const RotationMap& b) {
  const Rotation a_from_b = a.begin()->second.Inverse() * b.at(a.begin()->first);
  double largest = 0.0;
  for (const auto& [view, rotation] : a) {
    largest = std::max(largest, (rotation * a_from_b * b.at(view).Inverse()).AngleDeg());
  }
  return largest;
}

// Share of the views within 5 deg of the truth, in the world that fits most of them.
double ShareFound(const RotationMap& estimate, const RotationMap& truth) {
  std::size_t best = 0;
  std::size_t index = 0;
  for (const auto& [anchor, anchor_rotation] : estimate) {
    if (index++ % (1 + estimate.size() / 40) != 0) continue;
    const Rotation turn = anchor_rotation.Inverse() * truth.at(anchor);
    std::size_t count = 0;
    for (const auto& [view, rotation] : estimate) {
      count += (rotation * turn * truth.at(view).Inverse()).AngleDeg() < 5.0 ? 1 : 0;
    }
    best = std::max(best, count);
  }
  return static_cast<double>(best) / static_cast<double>(estimate.size());
}

// Views with fewer than two right edges, and pieces that only such edges tie to the rest, cannot be
// told: on these graphs that leaves 98 % to find among random edges at 40 %, 82 % on the grid at 30
// % and 99 % on the chain at 40 %.
TEST(AverageGlobally, LadderOfWrongEdges) {
  struct Rung {
    GraphShape shape;
    double wrong_ratio;
    double share_found;
    double median_deg;
  };
  for (const Rung rung : {Rung{GraphShape::kRandom, 0.0, 1.0, 0.4},
                          Rung{GraphShape::kRandom, 0.1, 1.0, 0.4},
                          Rung{GraphShape::kRandom, 0.2, 0.99, 0.4},
                          Rung{GraphShape::kRandom, 0.3, 0.99, 0.5},
                          Rung{GraphShape::kRandom, 0.4, 0.97, 0.5},
                          Rung{GraphShape::kGrid, 0.0, 1.0, 1.0},
                          Rung{GraphShape::kGrid, 0.1, 0.96, 1.0},
                          Rung{GraphShape::kGrid, 0.2, 0.9, 1.3},
                          Rung{GraphShape::kGrid, 0.3, 0.75, 1.6},
                          Rung{GraphShape::kChain, 0.0, 1.0, 0.8},
                          Rung{GraphShape::kChain, 0.1, 1.0, 0.8},
                          Rung{GraphShape::kChain, 0.2, 1.0, 0.8},
                          Rung{GraphShape::kChain, 0.3, 0.99, 0.9},
                          Rung{GraphShape::kChain, 0.4, 0.9, 1.4},
                          Rung{GraphShape::kCity, 0.0, 1.0, 0.4},
                          Rung{GraphShape::kCity, 0.2, 1.0, 0.4},
                          Rung{GraphShape::kCity, 0.4, 0.99, 0.5}}) {
    for (std::uint64_t seed = 1; seed <= 3; ++seed) {
      SCOPED_TRACE(testing::Message()
                   << NameOf(rung.shape) << ' ' << rung.wrong_ratio << " seed " << seed);
      const WrongEdges scene =
          MakeWrongEdges({.shape = rung.shape, .wrong_ratio = rung.wrong_ratio, .seed = seed});
      const GlobalAveragingResult result = Average(scene.edges);
      EXPECT_GE(ShareFound(result.cam_from_world, scene.true_cam_from_world), rung.share_found);
      EXPECT_LT(CompareOrientations(result.cam_from_world, scene.true_cam_from_world).median_deg,
                rung.median_deg);
    }
  }
}

// With these seeds long cycles of wrong edges close by chance, and the first trees believe them: 41
// to 67 % found. Of 100 seeds the worst finds 79 %.
TEST(AverageGlobally, BeginsAnewWhereChanceClosesCycles) {
  for (const std::uint64_t seed : {9, 11, 12, 24, 34, 36, 52, 67}) {
    const WrongEdges scene =
        MakeWrongEdges({.shape = GraphShape::kGrid, .wrong_ratio = 0.3, .seed = seed});
    const GlobalAveragingResult result = Average(scene.edges);
    EXPECT_GE(ShareFound(result.cam_from_world, scene.true_cam_from_world), 0.78) << seed;
  }
}

TEST(AverageGlobally, CleanEdgesGiveTheTruth) {
  for (const GraphShape shape :
       {GraphShape::kRandom, GraphShape::kGrid, GraphShape::kChain, GraphShape::kCity}) {
    const WrongEdges scene = MakeWrongEdges({.shape = shape, .noise_deg = 0.0});
    const GlobalAveragingResult result = Average(scene.edges);
    EXPECT_TRUE(result.has_converged);
    EXPECT_LT(MaxDifferenceDeg(result.cam_from_world, scene.true_cam_from_world), 1e-5);
    EXPECT_EQ(result.num_inliers, static_cast<int>(scene.edges.size()));
  }
}

TEST(AverageGlobally, AnyNumberOfThreadsGivesTheSameBits) {
  const WrongEdges scene =
      MakeWrongEdges({.shape = GraphShape::kCity, .num_views = 2000, .wrong_ratio = 0.2});
  const GlobalAveragingResult one = Average(scene.edges, {}, 1);
  const GlobalAveragingResult four = Average(scene.edges, {}, 4);
  for (const auto& [view, rotation] : one.cam_from_world) {
    ASSERT_EQ(rotation.Quaternion().coeffs(), four.cam_from_world.at(view).Quaternion().coeffs());
  }
}

TEST(AverageGlobally, FlippedEdgesAndOtherNamesChangeNothing) {
  const WrongEdges scene = MakeWrongEdges({.num_views = 60, .wrong_ratio = 0.1});
  std::vector<RelativeRotation> changed;
  changed.reserve(scene.edges.size());
  for (RelativeRotation edge : scene.edges) {
    edge.i = FrameId{59 - edge.i.value};
    edge.j = FrameId{59 - edge.j.value};
    changed.push_back(changed.size() % 2 == 0 ? Flipped(edge) : edge);
  }
  std::reverse(changed.begin(), changed.end());
  const RotationMap a = Average(scene.edges, Exact()).cam_from_world;
  RotationMap b;
  for (const auto& [view, rotation] : Average(changed, Exact()).cam_from_world) {
    b[FrameId{59 - view.value}] = rotation;
  }
  EXPECT_EQ(a.begin()->second.AngleDeg(), 0.0);
  EXPECT_LT(MaxDifferenceDeg(a, b), 1e-5);
}

TEST(AverageGlobally, TurnsWithHeldViews) {
  const WrongEdges scene = MakeWrongEdges({.shape = GraphShape::kGrid, .num_views = 100});
  const RotationMap free = Average(scene.edges, Exact()).cam_from_world;
  GlobalAveragingProblem problem;
  problem.edges = scene.edges;
  problem.held_views = {FrameId{40}};
  problem.cam_from_world[FrameId{40}] = Rotation::Exp({0.4, -1.1, 0.7});
  const RotationMap held = AverageGlobally(problem, Exact(), 1).cam_from_world;
  EXPECT_LT((held.at(FrameId{40}) * problem.cam_from_world.at(FrameId{40}).Inverse()).AngleDeg(),
            1e-12);
  EXPECT_LT(MaxDifferenceDeg(free, held), 1e-5);
}

TEST(AverageGlobally, SeveralHeldViewsStayAndPullTheOthers) {
  const WrongEdges scene =
      MakeWrongEdges({.shape = GraphShape::kChain, .num_views = 400, .wrong_ratio = 0.1});
  GlobalAveragingProblem problem;
  problem.edges = scene.edges;
  for (const int view : {0, 133, 266, 399}) {
    problem.held_views.insert(FrameId{view});
    problem.cam_from_world[FrameId{view}] = scene.true_cam_from_world.at(FrameId{view});
  }
  const GlobalAveragingResult result = AverageGlobally(problem, {}, 2);
  for (const FrameId view : problem.held_views) {
    EXPECT_EQ(result.cam_from_world.at(view).Quaternion().coeffs(),
              problem.cam_from_world.at(view).Quaternion().coeffs());
  }
  double sum = 0.0;
  for (const auto& [view, rotation] : result.cam_from_world) {
    sum += (rotation * scene.true_cam_from_world.at(view).Inverse()).AngleDeg();
  }
  EXPECT_LT(sum / 400.0, 1.5);
}

TEST(AverageGlobally, EveryComponentGetsAWorldOfItsOwn) {
  const WrongEdges first = MakeWrongEdges({.num_views = 50, .seed = 1});
  const WrongEdges second = MakeWrongEdges({.num_views = 30, .seed = 2});
  std::vector<RelativeRotation> edges = first.edges;
  RotationMap true_second;
  for (RelativeRotation edge : second.edges) {
    edge.i = FrameId{edge.i.value + 100};
    edge.j = FrameId{edge.j.value + 100};
    edges.push_back(edge);
  }
  const GlobalAveragingResult result = Average(edges, Exact());
  EXPECT_EQ(result.component_sizes, (std::vector<int>{50, 30}));
  EXPECT_EQ(result.component.at(FrameId{49}), 0);
  EXPECT_EQ(result.component.at(FrameId{100}), 1);
  EXPECT_EQ(result.cam_from_world.at(FrameId{0}).AngleDeg(), 0.0);
  EXPECT_EQ(result.cam_from_world.at(FrameId{100}).AngleDeg(), 0.0);
  RotationMap alone;
  for (const auto& [view, rotation] : Average(second.edges, Exact()).cam_from_world) {
    alone[FrameId{view.value + 100}] = rotation;
  }
  EXPECT_LT(MaxDifferenceDeg(alone, result.cam_from_world), 1e-6);
}

// Few free views are solved densely, many sparsely with isotropic or with general weights: the same
// minimum, where the windowed solver finds nothing to move.
TEST(AverageGlobally, SparseEqualsDense) {
  for (const bool isotropic : {true, false}) {
    const WrongEdges scene = MakeWrongEdges({.shape = GraphShape::kChain, .num_views = 60});
    std::mt19937_64 random(4);
    ViewGraph graph;
    for (RelativeRotation edge : scene.edges) {
      const Eigen::Vector3d sigma = 0.02 * RandomVector(random);
      if (!isotropic) edge.covariance += sigma * sigma.transpose();
      graph.AddEdge(edge);
    }
    GlobalAveragingOptions options = Exact();
    AveragingOptions windowed;
    windowed.edge_floor_deg = options.edge_floor_deg;
    windowed.loss_sigmas = options.loss_sigmas;
    windowed.min_step_deg = 1e-9;
    windowed.max_iterations = 200;
    const RotationMap averaged = Average(graph.edges(), options).cam_from_world;
    for (int begin = 1; begin < 50; begin += 10) {
      std::set<FrameId> window;
      for (int k = begin; k < begin + 10; ++k) window.insert(FrameId{k});
      for (const auto& [view, rotation] : AverageRotations(graph, averaged, window, windowed)) {
        EXPECT_LT((rotation * averaged.at(view).Inverse()).AngleDeg(), 1e-5) << view.value;
      }
    }
  }
}

TEST(AverageGlobally, RefusesWhatBreaksItsContract) {
  WrongEdges scene = MakeWrongEdges({.num_views = 20});
  GlobalAveragingOptions options;
  options.loss_decay = 1.0;
  EXPECT_THROW(Average(scene.edges, options), std::invalid_argument);
  GlobalAveragingProblem problem;
  problem.edges = scene.edges;
  problem.held_views = {FrameId{3}};
  EXPECT_THROW(AverageGlobally(problem, {}, 1), std::invalid_argument);
  std::vector<RelativeRotation> edges = scene.edges;
  edges[2].covariance(1, 1) = -1.0;
  EXPECT_THROW(Average(edges), std::invalid_argument);
  edges = scene.edges;
  edges[2].j = edges[2].i;
  EXPECT_THROW(Average(edges), std::invalid_argument);
  EXPECT_TRUE(Average({}).cam_from_world.empty());
}

// An odometry of 2,000 views: edges over up to 4 frames, whose noise is 0.01 deg as they say, but
// 0.3 deg into every hundredth frame; orientations chained over them.
struct Drifted {
  ViewGraph graph;
  RotationMap truth;
  RotationMap chained;
};

Drifted MakeDrifted() {
  constexpr int kNumViews = 2000;
  std::mt19937_64 random(7);
  Drifted scene;
  for (int j = 0; j < kNumViews; ++j) {
    const FrameId view_j{j};
    const FrameId before{j - 1};
    const Eigen::Vector3d turn = 0.03 * RandomVector(random);
    scene.truth[view_j] = j == 0 ? Rotation() : Rotation::Exp(turn) * scene.truth.at(before);
    // All edges across the bad step share its error.
    const Rotation bad =
        Rotation::Exp((j % 100 == 50 ? 0.3 * kRadFromDeg : 0.0) * RandomVector(random));
    for (int i = std::max(0, j - 4); i < j; ++i) {
      RelativeRotation edge = EdgeBetween(i, j);
      edge.j_from_i = Rotation::Exp(0.01 * kRadFromDeg * RandomVector(random)) * bad *
                      scene.truth.at(view_j) * scene.truth.at(FrameId{i}).Inverse();
      edge.covariance = std::pow(0.01 * kRadFromDeg, 2) * Eigen::Matrix3d::Identity();
      scene.graph.AddEdge(edge);
    }
    scene.chained[view_j] =
        j == 0 ? Rotation()
               : scene.graph.FindEdge(before, view_j)->j_from_i * scene.chained.at(before);
  }
  return scene;
}

void AddLoop(Drifted& scene, int i, int j, double wrong_deg, std::mt19937_64& random) {
  RelativeRotation edge = EdgeBetween(i, j);
  edge.covariance = std::pow(0.05 * kRadFromDeg, 2) * Eigen::Matrix3d::Identity();
  edge.j_from_i = Rotation::Exp(wrong_deg * kRadFromDeg * RandomVector(random).normalized()) *
                  Rotation::Exp(0.05 * kRadFromDeg * RandomVector(random)) *
                  scene.truth.at(edge.j) * scene.truth.at(edge.i).Inverse();
  scene.graph.AddEdge(edge);
}

TEST(CloseLoops, AdoptsRightLoopsAgainstDriftAndRefusesAFalseOne) {
  Drifted scene = MakeDrifted();
  std::mt19937_64 random(3);
  const std::size_t num_chain_edges = scene.graph.edges().size();
  for (const auto& [i, j] :
       {std::pair{10, 1980}, {250, 1500}, {400, 1200}, {30, 900}, {700, 1900}}) {
    AddLoop(scene, i, j, 0.0, random);
  }
  AddLoop(scene, 500, 1700, 20.0, random);
  const auto error_deg = [&](const RotationMap& estimate, const RelativeRotation& edge) {
    return (estimate.at(edge.j) * estimate.at(edge.i).Inverse() * edge.j_from_i.Inverse())
        .AngleDeg();
  };
  const GlobalAveragingResult result = CloseLoops(scene.graph.edges(), scene.chained, {}, 2);
  double largest_drift = 0.0;
  for (std::size_t k = num_chain_edges; k < scene.graph.edges().size(); ++k) {
    const RelativeRotation& edge = scene.graph.edges()[k];
    if (k + 1 == scene.graph.edges().size()) {
      EXPECT_GT(error_deg(result.cam_from_world, edge), 18.0);
      continue;
    }
    largest_drift = std::max(largest_drift, error_deg(scene.chained, edge));
    EXPECT_LT(error_deg(result.cam_from_world, edge), 0.5) << edge.i.value;
  }
  // Tens of a chain edge's deviations.
  EXPECT_GT(largest_drift, 1.5);
  const OrientationErrors before = CompareOrientations(scene.chained, scene.truth);
  const OrientationErrors after = CompareOrientations(result.cam_from_world, scene.truth);
  EXPECT_LT(after.median_deg, 0.6 * before.median_deg);
  EXPECT_EQ(result.cam_from_world.begin()->second.AngleDeg(), 0.0);
}

TEST(CloseLoops, LeavesADriftThatOnlyAFalseLoopContradicts) {
  Drifted scene = MakeDrifted();
  std::mt19937_64 random(3);
  AddLoop(scene, 100, 1900, 20.0, random);
  const GlobalAveragingResult result = CloseLoops(scene.graph.edges(), scene.chained, {}, 2);
  const double before = CompareOrientations(scene.chained, scene.truth).max_deg;
  EXPECT_LT(CompareOrientations(result.cam_from_world, scene.truth).max_deg, 1.5 * before + 0.1);
}

std::vector<double> Ones(const std::vector<RelativeRotation>& edges) {
  return std::vector<double>(edges.size(), 1.0);
}

TEST(CertifyAveraging, AcceptsTheOptimum) {
  for (const GraphShape shape : {GraphShape::kRandom, GraphShape::kGrid, GraphShape::kChain}) {
    const WrongEdges scene = MakeWrongEdges({.shape = shape, .num_views = 200, .noise_deg = 2.0});
    const AveragingCertificate certificate =
        CertifyAveraging(scene.edges, Ones(scene.edges), Average(scene.edges).cam_from_world);
    EXPECT_LT(certificate.gradient, 1e-9);
    EXPECT_LT(certificate.RelativeGap(), 1e-5) << NameOf(shape);
    EXPECT_LE(certificate.cost_bound, certificate.cost);
  }
}

// A ring whose views turn once around more than its edges say: stationary, but not the best.
TEST(CertifyAveraging, RefusesALocalMinimum) {
  constexpr int kNumViews = 12;
  std::vector<RelativeRotation> edges;
  edges.reserve(kNumViews);
  RotationMap wound;
  RotationMap right;
  for (int k = 0; k < kNumViews; ++k) {
    edges.push_back(EdgeBetween(k, (k + 1) % kNumViews));
    wound[FrameId{k}] = Rotation::Exp({0.0, 0.0, 2.0 * std::numbers::pi * k / kNumViews});
    right[FrameId{k}] = Rotation::Exp({0.01 * k, 0.02 * (k % 3), 0.0});
  }
  const AveragingCertificate local = CertifyAveraging(edges, Ones(edges), wound);
  EXPECT_GT(local.cost, 1.0);
  EXPECT_LT(local.gradient, 1e-6);
  EXPECT_LT(local.smallest_eigenvalue, -0.05);
  EXPECT_GT(local.RelativeGap(), 0.1);
  const AveragingCertificate global = CertifyAveraging(edges, Ones(edges), right);
  EXPECT_LT(global.cost, 1e-12);
  EXPECT_GT(global.smallest_eigenvalue, -1e-8);
}

TEST(CertifyAveraging, TellsWhatItCosts) {
  const WrongEdges scene = MakeWrongEdges({.num_views = 200, .noise_deg = 2.0});
  std::vector<CertificateProgress> told;
  CertifyAveraging(scene.edges,
                   Ones(scene.edges),
                   Average(scene.edges).cam_from_world,
                   [&](const CertificateProgress& progress) { told.push_back(progress); });
  ASSERT_GE(told.size(), 2u);
  ASSERT_LE(told.back().factorisations, kMaxCertificateFactorisations);
  for (std::size_t k = 0; k < told.size(); ++k) {
    EXPECT_EQ(told[k].factorisations, static_cast<int>(k));
    // At least the matrix' own entries, at most those of a full one.
    EXPECT_GE(told[k].entries, 9.0 * static_cast<double>(scene.edges.size()) / 2.0);
    EXPECT_LE(told[k].entries, 600.0 * 600.0 / 2.0);
  }
}

TEST(AverageGlobally, EdgesCanBeReportedAnew) {
  const WrongEdges scene = MakeWrongEdges({.num_views = 50, .wrong_ratio = 0.1});
  const GlobalAveragingResult result = Average(scene.edges);
  GlobalAveragingResult again = result;
  ReportEdges(scene.edges, {}, again);
  EXPECT_NEAR(again.cost, result.cost, 1e-9 * result.cost);
  EXPECT_EQ(again.num_inliers, result.num_inliers);
  for (std::size_t k = 0; k < result.sigmas.size(); ++k) {
    EXPECT_NEAR(again.sigmas[k], result.sigmas[k], 1e-6 * (1.0 + result.sigmas[k]));
  }
}

TEST(CertifyAveraging, RefusesWhatBreaksItsContract) {
  const WrongEdges scene = MakeWrongEdges({.num_views = 20});
  std::vector<double> weights = Ones(scene.edges);
  weights[3] = -1.0;
  EXPECT_THROW(CertifyAveraging(scene.edges, weights, scene.true_cam_from_world),
               std::invalid_argument);
  weights.pop_back();
  EXPECT_THROW(CertifyAveraging(scene.edges, weights, scene.true_cam_from_world),
               std::invalid_argument);
  EXPECT_THROW(CertifyAveraging(scene.edges, Ones(scene.edges), {}), std::invalid_argument);
}

}  // namespace
}  // namespace rotslam
