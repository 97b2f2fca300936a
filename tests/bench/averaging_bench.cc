#include <cmath>
#include <optional>
#include <set>
#include <vector>

#include <benchmark/benchmark.h>

#include "rotodom/averaging/averaging.h"
#include "rotodom/averaging/orientation_covariance.h"
#include "tests/scenes/rotation_graph.h"
#include "tests/scenes/tracked_edges.h"

namespace rotslam {
namespace {

void Assign(const RotationMap& averaged, RotationMap& cam_from_world) {
  for (const auto& [view, rotation] : averaged) cam_from_world[view] = rotation;
}

// The newest 10 views of a long sequence, the newest one started from its best edge. Edges go to
// the 4 views before and to 2 keyframes.
void BM_AverageWindow(benchmark::State& state) {
  RotationGraphOptions graph_options;
  graph_options.num_views = static_cast<int>(state.range(0));
  graph_options.keyframe_every = 8;
  graph_options.wrong_ratio = static_cast<double>(state.range(1)) / 100.0;
  const RotationGraph scene = MakeRotationGraph(graph_options);
  const AveragingOptions options;
  // All frames up to the last one, as the odometry does it.
  RotationMap start;
  std::set<FrameId> free_views;
  for (int k = 0; k < graph_options.num_views; ++k) {
    const FrameId view{k};
    start[view] =
        k == 0 ? Rotation()
               : scene.graph.FindEdge(FrameId{k - 1}, view)->j_from_i * start.at(FrameId{k - 1});
    free_views = ViewsToAverage(start, options);
    if (k + 1 < graph_options.num_views) {
      Assign(AverageRotations(scene.graph, start, free_views, options), start);
    }
  }
  RotationMap averaged;
  for (auto _ : state) {
    averaged = AverageRotations(scene.graph, start, free_views, options);
    benchmark::DoNotOptimize(averaged);
  }
  Assign(averaged, start);
  const RotationErrors errors = CompareRotations(start, scene.true_cam_from_world);
  state.counters["step_rms_mdeg"] = 1e3 * errors.step_rms_deg;
  state.counters["rms_mdeg"] = 1e3 * errors.rms_deg;
}
BENCHMARK(BM_AverageWindow)
    ->ArgNames({"views", "wrong_percent"})
    ->ArgsProduct({{30, 1000, 5000}, {0, 20}})
    ->Unit(benchmark::kMicrosecond);

// What the covariances take per frame beside the averaging: a new view and the two covariances that
// the odometry asks for, of the newest view and of the one that leaves the window.
void BM_OrientationCovariance(benchmark::State& state) {
  TrackedEdgesOptions scene_options;
  scene_options.path = TrackedPath::kHandheld;
  scene_options.num_views = static_cast<int>(state.range(0));
  scene_options.keyframe_every = 8;
  const TrackedEdges scene = MakeTrackedEdges(scene_options);
  const AveragingOptions options;
  std::vector<std::vector<SupportedEdge>> supported(scene.edges.size());
  for (std::size_t k = 0; k < scene.edges.size(); ++k) {
    for (const TrackedEdge& tracked : scene.edges[k]) {
      supported[k].push_back({tracked.edge, tracked.keypoint_pairs});
    }
  }
  // Good edges: what they cost does not depend on where exactly the orientations are.
  const RotationMap& rotations = scene.true_cam_from_world;
  double sigma_deg = 0.0;
  for (auto _ : state) {
    OrientationCovariance covariance(options);
    std::set<FrameId> window;
    for (int k = 0; k < scene_options.num_views; ++k) {
      if (k > 0) window.insert(FrameId{k});
      if (static_cast<int>(window.size()) > options.window) window.erase(window.begin());
      covariance.AddView(FrameId{k}, supported[k], rotations, window);
      sigma_deg = std::sqrt(covariance.Of(FrameId{k})->trace() / 3.0) * kDegFromRad;
      const std::optional<Eigen::Matrix3d> settled = covariance.Of(FrameId{k - options.window});
      benchmark::DoNotOptimize(settled);
    }
  }
  state.counters["sigma_mdeg"] = 1e3 * sigma_deg;
  state.counters["us_per_frame"] =
      benchmark::Counter(static_cast<double>(state.iterations() * scene_options.num_views) / 1e6,
                         benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
}
BENCHMARK(BM_OrientationCovariance)->ArgName("views")->Arg(60)->Arg(240);

// All views of a sequence, from the chain over its steps.
void BM_AverageGlobal(benchmark::State& state) {
  RotationGraphOptions graph_options;
  graph_options.num_views = static_cast<int>(state.range(0));
  graph_options.wrong_ratio = 0.1;
  const RotationGraph scene = MakeRotationGraph(graph_options);
  std::set<FrameId> free_views;
  for (int k = 1; k < graph_options.num_views; ++k) free_views.insert(FrameId{k});
  RotationMap averaged;
  for (auto _ : state) {
    averaged = AverageRotations(scene.graph, scene.chained_cam_from_world, free_views, {});
    benchmark::DoNotOptimize(averaged);
  }
  averaged[FrameId{0}] = Rotation();
  const RotationErrors errors = CompareRotations(averaged, scene.true_cam_from_world);
  state.counters["step_rms_mdeg"] = 1e3 * errors.step_rms_deg;
  state.counters["rms_mdeg"] = 1e3 * errors.rms_deg;
}
BENCHMARK(BM_AverageGlobal)
    ->ArgName("views")
    ->Arg(11)
    ->Arg(21)
    ->Arg(31)
    ->Arg(41)
    ->Arg(61)
    ->Arg(200)
    ->Arg(1000)
    ->Arg(5000)
    ->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace rotslam

BENCHMARK_MAIN();
