#include "rotodom/loop/training.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <span>
#include <stdexcept>
#include <utility>

#include "rotodom/types/options.h"
#include "rotodom/types/parallel.h"
#include "rotodom/types/splitmix64.h"

namespace rotslam {
namespace {

// Counts the ones of each of the 256 bits over many descriptors.
class BitCounter {
 public:
  void Add(const BinaryDescriptor& descriptor) {
    for (std::size_t byte = 0; byte < lanes_.size(); ++byte) {
      lanes_[byte] += Spread((descriptor[byte / 8] >> (byte % 8 * 8)) & 0xFFU);
    }
    ++count_;
    if (++pending_ == 255) Flush();
  }

  // A bit is set where at least half the descriptors have it.
  BinaryDescriptor Majority() {
    Flush();
    BinaryDescriptor majority = {};
    for (std::size_t bit = 0; bit < ones_.size(); ++bit) {
      if (2 * ones_[bit] >= count_) majority[bit / 64] |= std::uint64_t{1} << (bit % 64);
    }
    return majority;
  }

  std::uint64_t count() const { return count_; }

 private:
  // Moves bit k of a byte to byte k.
  static std::uint64_t Spread(std::uint64_t byte) {
    const std::uint64_t copies = byte * 0x0101010101010101U;
    const std::uint64_t bits = copies & 0x8040201008040201U;
    return (bits + 0x7F7F7F7F7F7F7F7FU) >> 7 & 0x0101010101010101U;
  }

  void Flush() {
    for (std::size_t bit = 0; bit < ones_.size(); ++bit) {
      ones_[bit] += (lanes_[bit / 8] >> (bit % 8 * 8)) & 0xFFU;
    }
    lanes_.fill(0);
    pending_ = 0;
  }

  std::array<std::uint64_t, 32> lanes_ = {};  // a byte per bit, to 255
  std::array<std::uint64_t, 256> ones_ = {};
  std::uint64_t count_ = 0;
  int pending_ = 0;
};

using Members = std::vector<std::uint32_t>;

// A future node: the descriptors [begin, end) of the members.
struct Cluster {
  std::size_t begin = 0;
  std::size_t end = 0;
  std::size_t size() const { return end - begin; }
};

struct Division {
  std::vector<BinaryDescriptor> centers;
  std::vector<std::size_t> sizes;
};

// Divides one cluster.
class Divider {
 public:
  Divider(const std::vector<BinaryDescriptor>& descriptors,
          std::span<std::uint32_t> members,
          const TrainingOptions& options)
      : descriptors_(descriptors), members_(members), options_(options) {}

  // Orders the members by part, within a part as before; one part when they are all equal.
  Division Divide(std::uint64_t seed) {
    ChooseCenters(seed);
    Assign();
    for (int iteration = 0; iteration < options_.max_iterations; ++iteration) {
      Average();
      if (!Assign()) break;
    }
    return SortByPart();
  }

 private:
  const BinaryDescriptor& Member(std::size_t k) const { return descriptors_[members_[k]]; }

  void ChooseCenters(std::uint64_t seed) {
    SplitMix64 random(seed);
    std::vector<int> distances(members_.size(), std::numeric_limits<int>::max());
    centers_.push_back(Member(random.Below(members_.size())));
    while (static_cast<int>(centers_.size()) < options_.branching) {
      std::uint64_t sum = 0;
      for (std::size_t k = 0; k < members_.size(); ++k) {
        distances[k] = std::min(distances[k], HammingDistance(Member(k), centers_.back()));
        sum += static_cast<std::uint64_t>(distances[k]);
      }
      if (sum == 0) return;  // fewer different descriptors than children
      std::uint64_t rest = random.Below(sum);
      std::size_t chosen = 0;
      while (rest >= static_cast<std::uint64_t>(distances[chosen])) {
        rest -= static_cast<std::uint64_t>(distances[chosen++]);
      }
      centers_.push_back(Member(chosen));
    }
  }

  // Assigns members to the nearest centre, the first among equals; false when nothing changes.
  bool Assign() {
    const bool is_first = parts_.empty();
    parts_.resize(members_.size());
    bool changed = is_first;
    for (std::size_t k = 0; k < members_.size(); ++k) {
      std::uint8_t nearest = 0;
      int least = std::numeric_limits<int>::max();
      for (std::size_t part = 0; part < centers_.size(); ++part) {
        const int distance = HammingDistance(Member(k), centers_[part]);
        if (distance < least) {
          least = distance;
          nearest = static_cast<std::uint8_t>(part);
        }
      }
      changed = changed || parts_[k] != nearest;
      parts_[k] = nearest;
    }
    return changed;
  }

  // A part without members keeps its center.
  void Average() {
    std::vector<BitCounter> counters(centers_.size());
    for (std::size_t k = 0; k < members_.size(); ++k) counters[parts_[k]].Add(Member(k));
    for (std::size_t part = 0; part < centers_.size(); ++part) {
      if (counters[part].count() > 0) centers_[part] = counters[part].Majority();
    }
  }

  Division SortByPart() {
    std::vector<Members> members_of(centers_.size());
    for (std::size_t k = 0; k < members_.size(); ++k) members_of[parts_[k]].push_back(members_[k]);
    Division division;
    auto to = members_.begin();
    for (std::size_t part = 0; part < centers_.size(); ++part) {
      if (members_of[part].empty()) continue;
      to = std::copy(members_of[part].begin(), members_of[part].end(), to);
      division.centers.push_back(centers_[part]);
      division.sizes.push_back(members_of[part].size());
    }
    return division;
  }

  const std::vector<BinaryDescriptor>& descriptors_;
  std::span<std::uint32_t> members_;
  const TrainingOptions& options_;
  std::vector<BinaryDescriptor> centers_;
  std::vector<std::uint8_t> parts_;
};

struct Level {
  const std::vector<Cluster>& clusters;
  std::uint64_t seed = 1;
};

// The clusters of one level divided, side by side; those too small to be divided give nothing.
std::vector<Division> DivideLevel(const std::vector<BinaryDescriptor>& descriptors,
                                  const Level& level,
                                  const TrainingOptions& options,
                                  int num_threads,
                                  Members& members) {
  std::vector<Division> divisions(level.clusters.size());
  ParallelFor(static_cast<int>(level.clusters.size()), num_threads, [&](int index) {
    const Cluster& cluster = level.clusters[index];
    if (cluster.size() < static_cast<std::size_t>(options.min_descriptors)) return;
    const std::span<std::uint32_t> part = std::span(members).subspan(cluster.begin, cluster.size());
    SplitMix64 random(level.seed ^ static_cast<std::uint64_t>(index));
    Division division = Divider(descriptors, part, options).Divide(random.Next());
    if (division.centers.size() > 1) divisions[index] = std::move(division);
  });
  return divisions;
}

VocabularyTree GrowTree(const std::vector<BinaryDescriptor>& descriptors,
                        const TrainingOptions& options,
                        int num_threads,
                        const std::function<void(int, int)>& progress) {
  VocabularyTree tree;
  tree.branching = options.branching;
  tree.depth = options.depth;
  tree.descriptors.push_back({});
  Members members(descriptors.size());
  std::iota(members.begin(), members.end(), 0U);
  std::vector<Cluster> clusters = {{0, members.size()}};
  SplitMix64 random(options.seed);
  for (int level = 0; level < options.depth && !clusters.empty(); ++level) {
    if (progress) progress(level, options.depth);
    const std::vector<Division> divisions =
        DivideLevel(descriptors, {clusters, random.Next()}, options, num_threads, members);
    std::vector<Cluster> next;
    for (std::size_t k = 0; k < clusters.size(); ++k) {
      tree.num_children.push_back(static_cast<std::uint8_t>(divisions[k].centers.size()));
      std::size_t begin = clusters[k].begin;
      for (std::size_t part = 0; part < divisions[k].centers.size(); ++part) {
        tree.descriptors.push_back(divisions[k].centers[part]);
        next.push_back({begin, begin + divisions[k].sizes[part]});
        begin = next.back().end;
      }
    }
    clusters = std::move(next);
  }
  tree.num_children.resize(tree.descriptors.size(), 0);
  tree.weights.assign(tree.descriptors.size(), 0.0F);
  return tree;
}

// Images that show each word.
std::vector<int> CountImages(const Vocabulary& vocabulary,
                             const std::vector<std::vector<BinaryDescriptor>>& descriptors_by_image,
                             int num_threads) {
  std::vector<std::vector<std::uint32_t>> words_by_image(descriptors_by_image.size());
  ParallelFor(static_cast<int>(words_by_image.size()), num_threads, [&](int image) {
    std::vector<std::uint32_t>& words = words_by_image[image];
    words.reserve(descriptors_by_image[image].size());
    for (const BinaryDescriptor& descriptor : descriptors_by_image[image]) {
      words.push_back(vocabulary.WordOf(descriptor));
    }
    std::sort(words.begin(), words.end());
    words.erase(std::unique(words.begin(), words.end()), words.end());
  });
  std::vector<int> counts(static_cast<std::size_t>(vocabulary.num_words()));
  for (const std::vector<std::uint32_t>& words : words_by_image) {
    for (const std::uint32_t word : words) ++counts[word];
  }
  return counts;
}

}  // namespace

std::optional<std::string> TrainingOptions::Problem() const {
  if (branching < 2 || branching > 255) return OutOfRange("branching", branching, "2 to 255");
  if (depth < 1 || depth > 20) return OutOfRange("depth", depth, "1 to 20");
  if (min_descriptors < 2) return OutOfRange("min_descriptors", min_descriptors, "at least 2");
  if (max_iterations < 0) return OutOfRange("max_iterations", max_iterations, "zero or more");
  return std::nullopt;
}

Vocabulary TrainVocabulary(const std::vector<std::vector<BinaryDescriptor>>& descriptors_by_image,
                           const TrainingOptions& options,
                           int num_threads,
                           const std::function<void(int level, int depth)>& progress) {
  if (const std::optional<std::string> problem = options.Problem()) {
    throw std::invalid_argument("TrainVocabulary: " + *problem);
  }
  if (descriptors_by_image.size() < 2) {
    throw std::invalid_argument("TrainVocabulary: at least two images are needed");
  }
  std::vector<BinaryDescriptor> descriptors;
  for (const auto& of_image : descriptors_by_image) {
    descriptors.insert(descriptors.end(), of_image.begin(), of_image.end());
  }
  VocabularyTree tree = GrowTree(descriptors, options, num_threads, progress);
  if (tree.num_children[0] == 0) {
    throw std::invalid_argument(
        "TrainVocabulary: too few different descriptors to divide them into words");
  }
  const std::vector<int> counts = CountImages(Vocabulary(tree), descriptors_by_image, num_threads);
  // Visits leaves in the order of their words, which is that of their positions. A word without a
  // descriptor of the images counts as one of a single image.
  std::size_t word = 0;
  for (std::size_t place = 0; place < tree.num_children.size(); ++place) {
    if (tree.num_children[place] > 0) continue;
    const double images_with_word = std::max(counts[word++], 1);
    tree.weights[place] = static_cast<float>(
        std::log(static_cast<double>(descriptors_by_image.size()) / images_with_word));
  }
  return Vocabulary(std::move(tree));
}

}  // namespace rotslam
