#include <benchmark/benchmark.h>

#include "tests/bench/relative_rotation_scenes.h"
#include "tests/rotodom/relative_rotation/opengv_reference.h"

namespace rotslam {
namespace {

void BM_OpenGvEigensolverRansac(benchmark::State& state) {
  RunOnScenes(state, [](const PairScene& scene) {
    return OpenGvReference(scene.pairs, kPairFocalPx).EigensolverRansac();
  });
}
BENCHMARK(BM_OpenGvEigensolverRansac)->Apply(RelativeRotationLadder);

void BM_OpenGvFivePointRansac(benchmark::State& state) {
  RunOnScenes(state, [](const PairScene& scene) {
    return OpenGvReference(scene.pairs, kPairFocalPx).FivePointRansac();
  });
}
BENCHMARK(BM_OpenGvFivePointRansac)->Apply(RelativeRotationLadder);

}  // namespace
}  // namespace rotslam
