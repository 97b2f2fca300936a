#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include <benchmark/benchmark.h>

#include "tests/rotodom/relative_rotation/pair_scene.h"

namespace rotslam {

/// Runs `estimate`, PairScene -> Rotation, on several scenes of state.range: matches, baseline over
/// depth in thousandths, wrong matches in per cent. One iteration is one edge; counters give the
/// median and the 90th percentile of the error over all scenes.
template <class Estimate>
void RunOnScenes(benchmark::State& state, const Estimate& estimate) {
  constexpr std::size_t kScenes = 40;
  std::vector<PairScene> scenes;
  for (std::size_t k = 0; k < kScenes; ++k) {
    scenes.push_back(
        MakePairScene({.num_pairs = static_cast<int>(state.range(0)),
                       .baseline_over_depth = 1e-3 * static_cast<double>(state.range(1)),
                       .outlier_ratio = 1e-2 * static_cast<double>(state.range(2)),
                       .seed = 1000 + k}));
  }
  std::size_t next = 0;
  for (auto _ : state) {
    Rotation j_from_i = estimate(scenes[next]);
    benchmark::DoNotOptimize(j_from_i);
    next = (next + 1) % kScenes;
  }
  std::vector<double> errors_deg;
  for (const PairScene& scene : scenes) {
    errors_deg.push_back((estimate(scene) * scene.j_from_i.Inverse()).AngleDeg());
  }
  std::sort(errors_deg.begin(), errors_deg.end());
  state.counters["median_deg"] = errors_deg[kScenes / 2];
  state.counters["p90_deg"] = errors_deg[kScenes * 9 / 10];
}

/// The ladder of matches, baselines and wrong matches.
inline void RelativeRotationLadder(benchmark::internal::Benchmark* bench) {
  bench->ArgNames({"matches", "baseline_permille", "wrong_percent"})
      ->ArgsProduct({{250, 1000, 2000}, {0, 10, 100}, {0, 25}})
      ->Unit(benchmark::kMicrosecond);
}

}  // namespace rotslam
