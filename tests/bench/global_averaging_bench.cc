#include <vector>

#include <benchmark/benchmark.h>
#include <sys/resource.h>

#include "rotodom/averaging/certificate.h"
#include "rotodom/averaging/global_averaging.h"
#include "tests/scenes/rotation_graph.h"
#include "tests/scenes/wrong_edges.h"

namespace rotslam {
namespace {

constexpr int kNumThreads = 2;

double PeakMegabytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024.0;
}

// Views, wrong edges in percent: 5,000 views have 25,000 edges at random, 20,000 on the chain and
// 50,000 in the city; 100,000 views have 1,000,000 in the city. The peak of the memory is the
// process', the graph included.
void BM_AverageGlobally(benchmark::State& state, GraphShape shape) {
  WrongEdgesOptions scene_options;
  scene_options.shape = shape;
  scene_options.num_views = static_cast<int>(state.range(0));
  scene_options.wrong_ratio = static_cast<double>(state.range(1)) / 100.0;
  const WrongEdges scene = MakeWrongEdges(scene_options);
  GlobalAveragingProblem problem;
  problem.edges = scene.edges;
  GlobalAveragingResult result;
  for (auto _ : state) {
    result = AverageGlobally(problem, {}, kNumThreads);
    benchmark::DoNotOptimize(result);
  }
  const OrientationErrors errors =
      CompareOrientations(result.cam_from_world, scene.true_cam_from_world);
  state.counters["edges"] = static_cast<double>(scene.edges.size());
  state.counters["iterations"] = result.iterations;
  state.counters["median_deg"] = errors.median_deg;
  state.counters["p99_deg"] = errors.p99_deg;
  state.counters["peak_MB"] = PeakMegabytes();
}
BENCHMARK_CAPTURE(BM_AverageGlobally, random, GraphShape::kRandom)
    ->ArgNames({"views", "wrong_percent"})
    ->ArgsProduct({{500, 5000}, {0, 10, 30}})
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime()
    ->UseRealTime();
BENCHMARK_CAPTURE(BM_AverageGlobally, chain, GraphShape::kChain)
    ->ArgNames({"views", "wrong_percent"})
    ->ArgsProduct({{5000}, {0, 10, 30}})
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime()
    ->UseRealTime();
BENCHMARK_CAPTURE(BM_AverageGlobally, city, GraphShape::kCity)
    ->ArgNames({"views", "wrong_percent"})
    ->ArgsProduct({{5000, 100000}, {10}})
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime()
    ->UseRealTime();

// An odometry's graph with its own orientations for a start.
void BM_CloseLoops(benchmark::State& state) {
  const int num_views = static_cast<int>(state.range(0));
  RotationGraph scene =
      MakeRotationGraph({.num_views = num_views, .keyframe_every = 8, .noise_deg = 0.01});
  for (int k = 0; k < 20; ++k) {
    RelativeRotation loop;
    loop.i = FrameId{k * num_views / 100};
    loop.j = FrameId{num_views - 1 - 3 * k};
    loop.j_from_i =
        scene.true_cam_from_world.at(loop.j) * scene.true_cam_from_world.at(loop.i).Inverse();
    loop.covariance = 1e-6 * Eigen::Matrix3d::Identity();
    scene.graph.AddEdge(loop);
  }
  GlobalAveragingResult result;
  for (auto _ : state) {
    result = CloseLoops(scene.graph.edges(), scene.chained_cam_from_world, {}, kNumThreads);
    benchmark::DoNotOptimize(result);
  }
  state.counters["edges"] = static_cast<double>(scene.graph.edges().size());
  state.counters["rms_mdeg_before"] =
      1e3 * CompareRotations(scene.chained_cam_from_world, scene.true_cam_from_world).rms_deg;
  state.counters["rms_mdeg"] =
      1e3 * CompareRotations(result.cam_from_world, scene.true_cam_from_world).rms_deg;
}
BENCHMARK(BM_CloseLoops)
    ->ArgName("views")
    ->Arg(2000)
    ->Arg(5000)
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime()
    ->UseRealTime();

void BM_CertifyAveraging(benchmark::State& state) {
  const WrongEdges scene = MakeWrongEdges({.shape = GraphShape::kChain,
                                           .num_views = static_cast<int>(state.range(0)),
                                           .noise_deg = 1.0});
  GlobalAveragingProblem problem;
  problem.edges = scene.edges;
  const RotationMap averaged = AverageGlobally(problem, {}, kNumThreads).cam_from_world;
  const std::vector<double> weights(scene.edges.size(), 1.0);
  AveragingCertificate certificate;
  for (auto _ : state) {
    certificate = CertifyAveraging(scene.edges, weights, averaged);
    benchmark::DoNotOptimize(certificate);
  }
  state.counters["gap"] = certificate.RelativeGap();
}
BENCHMARK(BM_CertifyAveraging)
    ->ArgName("views")
    ->Arg(500)
    ->Arg(2000)
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace rotslam

BENCHMARK_MAIN();
