#include "rotodom/averaging/orientation_covariance.h"

#include <cmath>
#include <map>
#include <numbers>
#include <set>
#include <stdexcept>
#include <vector>

#include <Eigen/Dense>
#include <gtest/gtest.h>

#include "rotodom/averaging/closure.h"
#include "tests/scenes/rotation_graph.h"
#include "tests/scenes/tracked_edges.h"

namespace rotslam {
namespace {

// Edges with independent errors, in the form of tracked ones.
TrackedEdges IndependentEdges(const RotationGraphOptions& options) {
  const RotationGraph graph = MakeRotationGraph(options);
  TrackedEdges scene;
  scene.true_cam_from_world = graph.true_cam_from_world;
  scene.edges.resize(options.num_views);
  for (const RelativeRotation& edge : graph.graph.edges()) {
    scene.edges[edge.j.value].push_back({edge, {}});
  }
  return scene;
}

// Worlds of points are as wrong as the edges' covariances say.
AveragingOptions WithoutModelError() {
  AveragingOptions options;
  options.edge_floor_deg = 0.2;
  options.loss_sigmas = 3.0;
  options.edge_error_factor = 1.0;
  options.lasting_share = 0.0;
  return options;
}

struct Processed {
  RotationMap cam_from_world;          // in the end
  std::map<FrameId, Rotation> newest;  // of every view when it was the newest
  std::map<FrameId, Eigen::Matrix3d> newest_covariance;
  std::map<FrameId, Rotation> settled;  // when it left the window
  std::map<FrameId, Eigen::Matrix3d> settled_covariance;
};

// The incremental scheme: start from the edge to the view before, average, covariances. `naive`
// keeps from the covariances which keypoints the edges share.
Processed Process(const TrackedEdges& scene, const AveragingOptions& options, bool naive = false) {
  OrientationCovariance covariance(options);
  ViewGraph graph;
  Processed run;
  for (int k = 0; k < static_cast<int>(scene.edges.size()); ++k) {
    const FrameId view{k};
    run.cam_from_world[view] = Rotation();
    std::vector<SupportedEdge> supported;
    for (const TrackedEdge& tracked : scene.edges[k]) {
      graph.AddEdge(tracked.edge);
      supported.push_back({tracked.edge, {}});
      if (!naive) supported.back().keypoint_pairs = tracked.keypoint_pairs;
    }
    if (!supported.empty()) {
      const RelativeRotation& last = supported.back().edge;
      run.cam_from_world[view] = last.j_from_i * run.cam_from_world.at(last.i);
    }
    std::set<FrameId> free_views = ViewsToAverage(run.cam_from_world, options);
    for (const auto& [moved, rotation] :
         AverageRotations(graph, run.cam_from_world, free_views, options)) {
      run.cam_from_world[moved] = rotation;
    }
    if (options.mode == AveragingMode::kOff) {
      free_views = {view};
      if (!supported.empty()) supported = {supported.back()};
    }
    covariance.AddView(view, supported, run.cam_from_world, free_views);
    run.newest[view] = run.cam_from_world.at(view);
    run.newest_covariance[view] = covariance.Of(view).value();
    const FrameId left{k - options.window};
    if (left.value < 0) continue;
    run.settled[left] = run.cam_from_world.at(left);
    run.settled_covariance[left] = covariance.Of(left).value();
  }
  return run;
}

// Mean squared Mahalanobis distance / 3, the first view left out, which has no error.
double NormalisedError(const std::map<FrameId, Rotation>& estimate,
                       const std::map<FrameId, Eigen::Matrix3d>& covariance,
                       const RotationMap& truth) {
  double sum = 0.0;
  for (const auto& [view, cam_from_world] : estimate) {
    if (view.value == 0) continue;
    const Eigen::Vector3d error = (cam_from_world * truth.at(view).Inverse()).Log();
    sum += error.dot(covariance.at(view).inverse() * error) / 3.0;
  }
  return sum / static_cast<double>(estimate.size() - 1);
}

struct Calibration {
  double newest = 0.0;
  double settled = 0.0;
};

constexpr std::uint64_t kNumSeeds = 8;

Calibration Calibrate(const std::vector<TrackedEdges>& scenes,
                      const AveragingOptions& options,
                      bool naive = false) {
  Calibration mean;
  const double count = static_cast<double>(scenes.size());
  for (const TrackedEdges& scene : scenes) {
    const Processed run = Process(scene, options, naive);
    const RotationMap& truth = scene.true_cam_from_world;
    mean.newest += NormalisedError(run.newest, run.newest_covariance, truth) / count;
    mean.settled += NormalisedError(run.settled, run.settled_covariance, truth) / count;
  }
  return mean;
}

struct World {
  const char* name;
  TrackedPath path;
  int keyframe_every;
};

std::vector<TrackedEdges> MakeScenes(TrackedPath path, int keyframe_every) {
  std::vector<TrackedEdges> scenes;
  for (std::uint64_t seed = 1; seed <= kNumSeeds; ++seed) {
    scenes.push_back(
        MakeTrackedEdges({.path = path, .keyframe_every = keyframe_every, .seed = seed}));
  }
  return scenes;
}

class InWorlds : public testing::TestWithParam<World> {};

INSTANTIATE_TEST_SUITE_P(OrientationCovariance,
                         InWorlds,
                         testing::Values(World{"Street", TrackedPath::kStreet, 0},
                                         World{"StreetWithKeyframes", TrackedPath::kStreet, 8},
                                         World{"Handheld", TrackedPath::kHandheld, 0},
                                         World{"HandheldWithKeyframes", TrackedPath::kHandheld, 8},
                                         World{"Pan", TrackedPath::kPan, 0},
                                         World{"PanWithKeyframes", TrackedPath::kPan, 8}),
                         [](const auto& world) { return std::string(world.param.name); });

// Points with their own noise in each frame, tracks that begin and end.
TEST_P(InWorlds, IsCalibrated) {
  const std::vector<TrackedEdges> scenes = MakeScenes(GetParam().path, GetParam().keyframe_every);
  // With 40 seeds: 0.94 to 1.43.
  const Calibration window = Calibrate(scenes, WithoutModelError());
  EXPECT_GT(window.newest, 0.5);
  EXPECT_LT(window.newest, 2.0);
  EXPECT_GT(window.settled, 0.5);
  EXPECT_LT(window.settled, 2.0);
  // With 40 seeds: 0.69 to 1.89.
  AveragingOptions options = WithoutModelError();
  options.mode = AveragingMode::kOff;
  const Calibration chain = Calibrate(scenes, options);
  EXPECT_GT(chain.newest, 0.5);
  EXPECT_LT(chain.newest, 2.2);
  // What images add makes clean worlds look worse than they are, never better.
  options = WithoutModelError();
  options.edge_error_factor = AveragingOptions().edge_error_factor;
  options.lasting_share = AveragingOptions().lasting_share;
  const Calibration by_default = Calibrate(scenes, options);
  EXPECT_LT(by_default.newest, window.newest);
  EXPECT_GT(by_default.newest, 0.02);
  RecordProperty("newest", std::to_string(window.newest));
  RecordProperty("settled", std::to_string(window.settled));
  RecordProperty("chain", std::to_string(chain.newest));
  RecordProperty("by_default", std::to_string(by_default.newest));
}

TEST(OrientationCovariance, CountingSharedNoiseTwiceWouldBeOverconfident) {
  const std::vector<TrackedEdges> scenes = MakeScenes(TrackedPath::kHandheld, 8);
  EXPECT_GT(Calibrate(scenes, WithoutModelError(), true).settled, 2.0);
}

TEST(OrientationCovariance, IsCalibratedForIndependentEdges) {
  for (const double noise_deg : {0.02, 0.5}) {
    for (const double wrong_ratio : {0.0, 0.2}) {
      std::vector<TrackedEdges> scenes;
      for (std::uint64_t seed = 1; seed <= kNumSeeds; ++seed) {
        scenes.push_back(IndependentEdges({.num_views = 60,
                                           .keyframe_every = 8,
                                           .noise_deg = noise_deg,
                                           .wrong_ratio = wrong_ratio,
                                           .seed = seed}));
      }
      const Calibration result = Calibrate(scenes, WithoutModelError());
      SCOPED_TRACE(testing::Message() << noise_deg << " deg, wrong " << wrong_ratio);
      EXPECT_GT(result.newest, 0.5);
      EXPECT_LT(result.newest, 2.0);
      EXPECT_GT(result.settled, 0.5);
      EXPECT_LT(result.settled, 2.0);
    }
  }
}

// Correlation of what a slowly changing rate builds up over the views of two edges, as a sum.
double LastingCorrelation(const RelativeRotation& a, const RelativeRotation& b, double scale) {
  const auto common = [&](const RelativeRotation& first, const RelativeRotation& second) {
    constexpr double kStep = 1.0 / 64.0;
    double sum = 0.0;
    for (double s = first.i.value + kStep / 2; s < first.j.value; s += kStep) {
      for (double t = second.i.value + kStep / 2; t < second.j.value; t += kStep) {
        sum += std::exp(-std::abs(s - t) / scale);
      }
    }
    return sum;
  };
  return common(a, b) / std::sqrt(common(a, a) * common(b, b));
}

class OfTheWholeScheme : public testing::TestWithParam<double> {};

INSTANTIATE_TEST_SUITE_P(OrientationCovariance, OfTheWholeScheme, testing::Values(0.0, 0.4));

// The slow and obvious way: the whole incremental scheme is run again for every component of every
// edge's error, and the covariance of all edges is written down as one matrix.
TEST_P(OfTheWholeScheme, EqualsTheDerivative) {
  TrackedEdgesOptions scene_options;
  scene_options.path = TrackedPath::kPan;
  scene_options.num_views = 14;
  scene_options.keyframe_every = 5;
  const TrackedEdges scene = MakeTrackedEdges(scene_options);
  AveragingOptions options = WithoutModelError();
  options.window = 4;
  options.min_step_deg = 1e-11;
  options.edge_error_factor = 1.3;
  options.lasting_share = GetParam();
  options.lasting_views = 3.0;
  const Processed run = Process(scene, options);

  struct Place {
    int view;
    int position;
  };
  std::vector<Place> edges;
  for (int k = 0; k < static_cast<int>(scene.edges.size()); ++k) {
    for (int e = 0; e < static_cast<int>(scene.edges[k].size()); ++e) edges.push_back({k, e});
  }
  const auto edge_at = [&](const Place& place) -> const TrackedEdge& {
    return scene.edges[place.view][place.position];
  };
  const int size = 3 * static_cast<int>(edges.size());
  // In the world's frame, to first order the same for estimate and truth.
  Eigen::MatrixXd C = Eigen::MatrixXd::Zero(size, size);
  const auto root_in_world = [&](const RelativeRotation& edge) {
    const Eigen::Matrix3d R = scene.true_cam_from_world.at(edge.j).Matrix();
    const Eigen::Matrix3d half = 0.5 * 1.3 * 1.3 * R.transpose() * edge.covariance * R;
    return Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(half).operatorSqrt();
  };
  for (int a = 0; a < static_cast<int>(edges.size()); ++a) {
    for (int b = 0; b < static_cast<int>(edges.size()); ++b) {
      const TrackedEdge& first = edge_at(edges[a]);
      const TrackedEdge& second = edge_at(edges[b]);
      const double lasting = options.lasting_share;
      double share = 2.0 * (a == b ? 1.0 : 0.0);
      if (a != b && lasting > 0.0) {
        share = 2.0 * lasting * LastingCorrelation(first.edge, second.edge, options.lasting_views);
      }
      for (const auto& p : first.keypoint_pairs) {
        for (const auto& q : second.keypoint_pairs) {
          if (a == b || p[0] != q[0]) continue;
          const double one = (1.0 - lasting) * options.shared_noise /
                             std::sqrt(static_cast<double>(first.keypoint_pairs.size()) *
                                       static_cast<double>(second.keypoint_pairs.size()));
          if (first.edge.i == second.edge.i || first.edge.j == second.edge.j) share += one;
          if (first.edge.i == second.edge.j || first.edge.j == second.edge.i) share -= one;
        }
      }
      if (std::abs(share) < 0.1) continue;  // as the class does
      C.block<3, 3>(3 * a, 3 * b) = share * root_in_world(first.edge) * root_in_world(second.edge);
    }
  }
  std::map<FrameId, Eigen::MatrixXd> J;  // of the settled orientations
  const double h = 1e-5;
  for (int a = 0; a < static_cast<int>(edges.size()); ++a) {
    for (int axis = 0; axis < 3; ++axis) {
      TrackedEdges changed = scene;
      RelativeRotation& edge = changed.edges[edges[a].view][edges[a].position].edge;
      const Eigen::Vector3d in_j =
          scene.true_cam_from_world.at(edge.j) * Eigen::Vector3d(h * Eigen::Vector3d::Unit(axis));
      edge.j_from_i = Rotation::Exp(in_j) * edge.j_from_i;
      for (const auto& [view, cam_from_world] : Process(changed, options).settled) {
        Eigen::MatrixXd& of_view =
            J.try_emplace(view, Eigen::MatrixXd::Zero(3, size)).first->second;
        of_view.col(3 * a + axis) = (cam_from_world * run.settled.at(view).Inverse()).Log() / h;
      }
    }
  }
  int num_checked = 0;
  for (const auto& [view, covariance] : run.settled_covariance) {
    const Eigen::Matrix3d expected = J.at(view) * C * J.at(view).transpose();
    EXPECT_LE((covariance - expected).norm(), 0.003 * expected.norm()) << view.value;
    num_checked += expected.norm() > 0.0;
  }
  EXPECT_EQ(num_checked, 9);
}

TEST(OrientationCovariance, OfAChainIsTheSumOfItsEdges) {
  const TrackedEdges scene = IndependentEdges({.num_views = 25, .reach = 1, .noise_deg = 0.1});
  AveragingOptions options;
  options.mode = AveragingMode::kOff;
  options.edge_error_factor = 2.0;
  options.lasting_share = 0.0;
  const Processed run = Process(scene, options);
  for (const auto& [view, covariance] : run.newest_covariance) {
    const double variance = view.value * 0.2 * 0.2 * kRadFromDeg * kRadFromDeg;
    EXPECT_LT((covariance - variance * Eigen::Matrix3d::Identity()).norm(), 1e-6 * variance + 1e-9)
        << view.value;
  }
}

TEST(OrientationCovariance, BetweenTwoViewsIsWhatTheyDoNotShare) {
  // Along a chain of equal edges the turn between two views is as uncertain as the edges between.
  const TrackedEdges scene = IndependentEdges({.num_views = 12, .reach = 1, .noise_deg = 0.1});
  AveragingOptions options = WithoutModelError();
  OrientationCovariance covariance(options);
  std::set<FrameId> window;
  for (int k = 0; k < 12; ++k) {
    std::vector<SupportedEdge> edges;
    for (const TrackedEdge& tracked : scene.edges[k]) edges.push_back({tracked.edge, {}});
    if (k > 0) window.insert(FrameId{k});
    if (k > 6) window.erase(window.begin());
    covariance.AddView(FrameId{k}, edges, scene.true_cam_from_world, window);
  }
  const double edge_variance = 0.1 * 0.1 * kRadFromDeg * kRadFromDeg;
  for (const int i : {4, 7, 10}) {  // held and free
    const auto between = covariance.Between(FrameId{i}, FrameId{11});
    ASSERT_TRUE(between.has_value());
    const Eigen::Matrix3d expected = (11 - i) * edge_variance * Eigen::Matrix3d::Identity();
    EXPECT_LT((*between - expected).norm(), 1e-6 * expected.norm()) << i;
  }
  EXPECT_LT(covariance.Between(FrameId{9}, FrameId{9})->norm(), 1e-9 * edge_variance);
  EXPECT_FALSE(covariance.Between(FrameId{9}, FrameId{99}).has_value());
}

TEST(OrientationCovariance, LastingErrorsAddUp) {
  const TrackedEdges scene = IndependentEdges({.num_views = 40, .reach = 1, .noise_deg = 0.1});
  AveragingOptions options = WithoutModelError();
  const double alone = Process(scene, options).newest_covariance.at(FrameId{39}).trace();
  options.lasting_share = 1.0;
  options.lasting_views = 4.0;
  const double lasting = Process(scene, options).newest_covariance.at(FrameId{39}).trace();
  // The errors of steps, correlated by about exp(-1/4) from each to the next, are summed.
  EXPECT_GT(lasting, 4.0 * alone);
  EXPECT_LT(lasting, 9.0 * alone);
}

TEST(OrientationCovariance, TrianglesTellWhereEdgesAreWorseThanTheySay) {
  constexpr double kFactor = 9.0;  // of the edges' variances
  double plain = 0.0;
  double by_closures = 0.0;
  for (std::uint64_t seed = 1; seed <= kNumSeeds; ++seed) {
    TrackedEdges scene = IndependentEdges({.num_views = 60, .noise_deg = 0.1, .seed = seed});
    ViewGraph graph;
    for (std::vector<TrackedEdge>& edges : scene.edges) {
      for (TrackedEdge& tracked : edges) {
        tracked.edge.covariance /= kFactor;
        graph.AddEdge(tracked.edge);
      }
    }
    const double variance = ClosureVariance(graph);
    EXPECT_NEAR(variance, kFactor, 0.3 * kFactor);
    const Processed run = Process(scene, WithoutModelError());
    const double error =
        NormalisedError(run.newest, run.newest_covariance, scene.true_cam_from_world);
    plain += error / kNumSeeds;
    by_closures += error / variance / kNumSeeds;
  }
  EXPECT_GT(plain, 4.0);
  EXPECT_GT(by_closures, 0.5);
  EXPECT_LT(by_closures, 2.0);
}

TEST(OrientationCovariance, GrowsWithTheDrift) {
  const Processed run = Process(IndependentEdges({.num_views = 200, .noise_deg = 0.1}), {});
  EXPECT_EQ(run.newest_covariance.at(FrameId{0}).norm(), 0.0);
  double last = 0.0;
  for (const int k : {10, 20, 40, 80, 160}) {
    const double trace = run.newest_covariance.at(FrameId{k}).trace();
    EXPECT_GT(trace, 1.5 * last) << k;
    EXPECT_LT(run.settled_covariance.at(FrameId{k}).trace(), trace) << k;
    last = trace;
  }
}

TEST(OrientationCovariance, WeightsAreOnlyWeights) {
  // Edges of one accuracy weigh the same whatever the floor.
  const TrackedEdges scene = IndependentEdges({.num_views = 40, .noise_deg = 0.05});
  AveragingOptions options;
  options.loss_sigmas = 1e3;
  const Processed with_floor = Process(scene, options);
  options.edge_floor_deg = 1e-3;
  const Processed without = Process(scene, options);
  for (const auto& [view, covariance] : with_floor.newest_covariance) {
    const Eigen::Matrix3d& other = without.newest_covariance.at(view);
    EXPECT_LT((covariance - other).norm(), 1e-3 * covariance.norm() + 1e-15) << view.value;
  }
}

TEST(OrientationCovariance, IsSeenFromTheCamera) {
  // One edge, uncertain about the second camera's x axis alone, that camera looking sideways.
  TrackedEdges scene;
  scene.edges.resize(2);
  RelativeRotation edge{FrameId{0}, FrameId{1}, Rotation::Exp({0.0, 1.5, 0.3})};
  edge.covariance = Eigen::Vector3d(1e-4, 1e-8, 1e-8).asDiagonal();
  scene.edges[1].push_back({edge, {}});
  const Processed run = Process(scene, WithoutModelError());
  EXPECT_LT((run.newest_covariance.at(FrameId{1}) - edge.covariance).norm(),
            1e-4 * edge.covariance.norm());
}

TEST(OrientationCovariance, AViewThatNothingTiesIsUnknown) {
  TrackedEdges scene = IndependentEdges({.num_views = 30, .noise_deg = 0.1});
  // View 15 and all after it know nothing of those before.
  for (int k = 15; k < 30; ++k) {
    std::erase_if(scene.edges[k], [](const TrackedEdge& edge) { return edge.edge.i.value < 15; });
  }
  const Processed run = Process(scene, {});
  const double unknown = std::numbers::pi * std::numbers::pi;
  EXPECT_LT(run.newest_covariance.at(FrameId{14}).norm(), 1e-3);
  for (int k = 15; k < 30; ++k) {
    EXPECT_GE(run.newest_covariance.at(FrameId{k}).diagonal().minCoeff(), 0.999 * unknown) << k;
  }
}

TEST(OrientationCovariance, ForgetsOldViews) {
  const TrackedEdges scene = IndependentEdges({.num_views = 60, .noise_deg = 0.1});
  AveragingOptions options;
  OrientationCovariance covariance(options);
  for (int k = 0; k < 60; ++k) {
    std::vector<SupportedEdge> edges;
    for (const TrackedEdge& tracked : scene.edges[k]) edges.push_back({tracked.edge, {}});
    std::set<FrameId> window;
    for (int other = std::max(1, k - 9); other <= k; ++other) window.insert(FrameId{other});
    covariance.AddView(FrameId{k}, edges, scene.true_cam_from_world, window);
  }
  EXPECT_FALSE(covariance.Of(FrameId{20}).has_value());
  EXPECT_TRUE(covariance.Of(FrameId{45}).has_value());
  EXPECT_FALSE(covariance.Of(FrameId{99}).has_value());
}

TEST(OrientationCovariance, RejectsABrokenContract) {
  AveragingOptions bad;
  bad.shared_noise = 1.5;
  EXPECT_THROW(OrientationCovariance{bad}, std::invalid_argument);
  OrientationCovariance covariance{AveragingOptions{}};
  const RotationMap start = {{FrameId{3}, Rotation()}};
  covariance.AddView(FrameId{3}, {}, start, {});
  EXPECT_THROW(covariance.AddView(FrameId{3}, {}, start, {}), std::invalid_argument);
}

}  // namespace
}  // namespace rotslam
