// Time of visual words beside what they give: transform, query, loading, memory.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <random>
#include <vector>

#include <benchmark/benchmark.h>

#include "rotodom/loop/default_vocabulary.h"
#include "rotodom/loop/place_database.h"
#include "rotodom/loop/vocabulary_file.h"
#include "tests/rotodom/loop/random_vocabulary.h"

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

BENCHMARK(BM_Transform)->ArgName("levels_up")->Arg(0)->Arg(3)->Unit(benchmark::kMicrosecond);
BENCHMARK(BM_Query)->ArgName("frames")->Arg(1000)->Arg(10000)->Unit(benchmark::kMicrosecond);
BENCHMARK(BM_AddFrame)->Unit(benchmark::kMicrosecond);
BENCHMARK(BM_MemoryOfDirectIndex)->Unit(benchmark::kMicrosecond);
BENCHMARK(BM_LoadBinary)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace rotslam

BENCHMARK_MAIN();
