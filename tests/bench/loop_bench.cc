// Time of visual words beside what they give: transform, query, loading, memory; and how long loops
// hold up a stream.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <map>
#include <random>
#include <thread>
#include <vector>

#include <benchmark/benchmark.h>

#include "rotodom/loop/default_vocabulary.h"
#include "rotodom/loop/looped_orientations.h"
#include "rotodom/loop/place_database.h"
#include "rotodom/loop/vocabulary_file.h"
#include "tests/rotodom/loop/random_vocabulary.h"
#include "tests/scenes/rotation_graph.h"

namespace rotslam {
namespace {

constexpr int kNumFeatures = 2000;

// Noisy copies of words, as features of an image are: nearest children are not a coin's toss.
std::vector<BinaryDescriptor> ImageLike(const Vocabulary& vocabulary, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  const std::vector<BinaryDescriptor>& nodes = vocabulary.tree().descriptors;
  std::vector<BinaryDescriptor> descriptors;
  for (int k = 0; k < kNumFeatures; ++k) {
    descriptors.push_back(Noisy(nodes[1 + random() % (nodes.size() - 1)], 20, random));
  }
  return descriptors;
}

void BM_Transform(benchmark::State& state) {
  const Vocabulary vocabulary = DefaultVocabulary();
  std::vector<std::vector<BinaryDescriptor>> images;
  for (std::uint64_t seed = 0; seed < 16; ++seed) images.push_back(ImageLike(vocabulary, seed));
  ImageWords words;
  std::size_t next = 0;
  for (auto _ : state) {
    words = vocabulary.Transform(images[next++ % images.size()], static_cast<int>(state.range(0)));
    benchmark::DoNotOptimize(words.bag.data());
  }
  state.counters["words"] = static_cast<double>(words.bag.size());
  state.counters["nodes"] = static_cast<double>(words.index.nodes.size());
  state.counters["score_of_itself"] = Score(words.bag, words.bag);
}

// The r-th most common word comes with probability proportional to 1 / (r + 1000), so that two
// frames share as many words as those of KITTI 00 and 7-Scenes kitchen do in the mean, 141 and 143.
class Words {
 public:
  explicit Words(int num_words) : random_(1), cumulative_(num_words) {
    double sum = 0.0;
    for (int k = 0; k < num_words; ++k) cumulative_[k] = sum += 1.0 / (k + 1000.0);
  }
  BagOfWords Bag() {
    std::map<std::uint32_t, int> counts;
    std::uniform_real_distribution<double> uniform(0.0, cumulative_.back());
    for (int k = 0; k < kNumFeatures; ++k) {
      const auto place = std::lower_bound(cumulative_.begin(), cumulative_.end(), uniform(random_));
      // Common words are anywhere among the ids.
      const auto rank = static_cast<std::uint64_t>(place - cumulative_.begin());
      ++counts[static_cast<std::uint32_t>(rank * 48271 % cumulative_.size())];
    }
    BagOfWords bag;
    for (const auto& [word, count] : counts) {
      bag.push_back({word, static_cast<float>(count) / static_cast<float>(kNumFeatures)});
    }
    return bag;
  }

 private:
  std::mt19937_64 random_;
  std::vector<double> cumulative_;
};

void BM_Query(benchmark::State& state) {
  constexpr int kNumWords = 100000;
  const int num_frames = static_cast<int>(state.range(0));
  Words words(kNumWords);
  PlaceDatabase database(kNumWords);
  const std::size_t empty_bytes = database.MemoryBytes();
  for (int k = 0; k < num_frames; ++k) database.Add(FrameId{k}, words.Bag());
  const BagOfWords bag = words.Bag();
  std::vector<PlaceMatch> matches;
  for (auto _ : state) {
    matches = database.Query(bag);
    benchmark::DoNotOptimize(matches.data());
  }
  double common_words = 0.0;
  for (const PlaceMatch& match : matches) common_words += match.common_words;
  state.counters["frames_found"] = static_cast<double>(matches.size());
  state.counters["common_words"] = common_words / static_cast<double>(matches.size());
  state.counters["words"] = static_cast<double>(bag.size());
  state.counters["empty_MB"] = static_cast<double>(empty_bytes) / 1e6;
  state.counters["MB_per_1000"] =
      static_cast<double>(database.MemoryBytes() - empty_bytes) / 1e3 / num_frames;
}

void BM_AddFrame(benchmark::State& state) {
  constexpr int kNumWords = 100000;
  Words words(kNumWords);
  std::vector<BagOfWords> bags;
  for (int k = 0; k < 200; ++k) bags.push_back(words.Bag());
  PlaceDatabase database(kNumWords);
  int next = 0;
  for (auto _ : state) {
    database.Add(FrameId{next}, bags[next % bags.size()]);
    ++next;
    if (next >= 2000) database.Erase(FrameId{next - 2000});
  }
  state.counters["frames"] = database.size();
}

// Of the shipped vocabulary, with the direct index of an image beside it.
void BM_MemoryOfDirectIndex(benchmark::State& state) {
  const Vocabulary vocabulary = DefaultVocabulary();
  const std::vector<BinaryDescriptor> image = ImageLike(vocabulary, 1);
  DirectIndex index;
  for (auto _ : state) {
    index = vocabulary.Transform(image, 3).index;
    benchmark::DoNotOptimize(index.features.data());
  }
  state.counters["MB_per_1000"] =
      static_cast<double>(sizeof(index) + 4 * index.nodes.capacity() + 4 * index.starts.capacity() +
                          2 * index.features.capacity()) /
      1e3;
}

void BM_LoadBinary(benchmark::State& state) {
  const std::string bytes = EncodeBinary(DefaultVocabulary());
  int num_words = 0;
  for (auto _ : state) {
    num_words = DecodeBinary(bytes, "benchmark").num_words();
    benchmark::DoNotOptimize(num_words);
  }
  state.counters["words"] = num_words;
  state.counters["bytes"] = static_cast<double>(bytes.size());
}

constexpr int kFramesPerLoop = 500;

// Frames as an odometry would give them, at 30 per second while orientations are averaged; every
// 500th leads back to the first ones.
void BM_Stream(benchmark::State& state) {
  constexpr std::chrono::milliseconds kPeriod(33);
  const int num_frames = static_cast<int>(state.range(0));
  const RotationGraph scene =
      MakeRotationGraph({.num_views = num_frames, .keyframe_every = 8, .noise_deg = 0.02});
  LoopOptions options;
  options.handover_frames = static_cast<int>(state.range(1));
  double longest_s = 0.0;
  double averaging_s = 0.0;
  RotationMap averaged;
  int num_moved = 0;
  for (auto _ : state) {
    LoopedOrientations orientations({}, options, false, 2);
    for (int k = 0; k < num_frames; ++k) {
      FrameEstimate estimate;
      estimate.frame = FrameId{k};
      for (const int index : scene.graph.EdgesOf(estimate.frame)) {
        const RelativeRotation& edge = scene.graph.edges()[index];
        if (edge.j == estimate.frame) estimate.connections.push_back({edge, {}, {}});
      }
      for (int view = std::max(0, k - 9); view <= k; ++view) {
        estimate.window[FrameId{view}] = scene.chained_cam_from_world.at(FrameId{view});
      }
      std::vector<EdgeWithMatches> loop;
      const int since_loop = k % kFramesPerLoop;
      if (since_loop == 0 && k > 0) {
        RelativeRotation edge;
        edge.i = FrameId{k / kFramesPerLoop};
        edge.j = estimate.frame;
        edge.j_from_i =
            scene.true_cam_from_world.at(edge.j) * scene.true_cam_from_world.at(edge.i).Inverse();
        edge.covariance = 1e-7 * Eigen::Matrix3d::Identity();
        loop.push_back({edge, {}, {}});
      }
      const auto start = std::chrono::steady_clock::now();
      orientations.BeginFrame(estimate);
      orientations.AddFrame(std::move(estimate));
      orientations.AddLoop(std::move(loop));
      num_moved += orientations.EndFrame() ? 1 : 0;
      const std::chrono::duration<double> passed = std::chrono::steady_clock::now() - start;
      longest_s = std::max(longest_s, passed.count());
      if (k >= kFramesPerLoop && since_loop < options.handover_frames) {
        std::this_thread::sleep_until(start + kPeriod);
      }
    }
    averaging_s = orientations.averaging_seconds() / num_moved;
    averaged = orientations.result().cam_from_world;
  }
  state.counters["edges"] = static_cast<double>(scene.graph.edges().size());
  state.counters["longest_ms"] = 1e3 * longest_s;
  state.counters["averaging_ms"] = 1e3 * averaging_s;
  state.counters["averagings"] = num_moved;
  state.counters["rms_deg_chained"] =
      CompareRotations(scene.chained_cam_from_world, scene.true_cam_from_world).rms_deg;
  state.counters["rms_deg"] = CompareRotations(averaged, scene.true_cam_from_world).rms_deg;
}

BENCHMARK(BM_Stream)
    ->ArgNames({"frames", "handover"})
    ->ArgsProduct({{1600, 4600, 10100}, {0, 5}})
    ->Iterations(1)
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK(BM_Transform)->ArgName("levels_up")->Arg(0)->Arg(3)->Unit(benchmark::kMicrosecond);
BENCHMARK(BM_Query)->ArgName("frames")->Arg(1000)->Arg(10000)->Unit(benchmark::kMicrosecond);
BENCHMARK(BM_AddFrame)->Unit(benchmark::kMicrosecond);
BENCHMARK(BM_MemoryOfDirectIndex)->Unit(benchmark::kMicrosecond);
BENCHMARK(BM_LoadBinary)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace rotslam

BENCHMARK_MAIN();
