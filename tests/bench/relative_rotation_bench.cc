#include <benchmark/benchmark.h>

#include "rotodom/relative_rotation/relative_rotation.h"
#include "tests/bench/relative_rotation_scenes.h"

namespace rotslam {
namespace {

void BM_EstimateRelativeRotation(benchmark::State& state) {
  RunOnScenes(state, [](const PairScene& scene) {
    const auto estimate = EstimateRelativeRotation({scene.pairs}, Rotation(), kPairFocalPx, {}, 1);
    return estimate ? estimate->j_from_i : Rotation();
  });
}
BENCHMARK(BM_EstimateRelativeRotation)->Apply(RelativeRotationLadder);

// The same with a covariance for every match.
void BM_EstimateRelativeRotationWeighted(benchmark::State& state) {
  RunOnScenes(state, [](const PairScene& scene) {
    std::vector<BearingPair> pairs = scene.pairs;
    for (BearingPair& pair : pairs) pair.noise = MatchNoise{};
    const auto estimate = EstimateRelativeRotation({pairs}, Rotation(), kPairFocalPx, {}, 1);
    return estimate ? estimate->j_from_i : Rotation();
  });
}
BENCHMARK(BM_EstimateRelativeRotationWeighted)->Apply(RelativeRotationLadder);

}  // namespace
}  // namespace rotslam
