#include "rotodom/loop/vocabulary.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <utility>

#include "rotodom/types/options.h"

namespace rotslam {
namespace {

constexpr std::size_t kMaxDescriptors = std::numeric_limits<std::uint16_t>::max() + std::size_t{1};

// Descriptors that descend the tree together, so that nodes are loaded while others are compared:
// twice as fast as one after the other.
constexpr std::size_t kBatch = 64;

std::optional<std::string> ProblemOfShape(const VocabularyTree& tree) {
  if (tree.branching < 2 || tree.branching > 255) {
    return OutOfRange("branching", tree.branching, "2 to 255");
  }
  if (tree.depth < 1 || tree.depth > 20) return OutOfRange("depth", tree.depth, "1 to 20");
  const std::size_t count = tree.num_children.size();
  if (count < 2) return "there are no words";
  if (count > std::numeric_limits<std::int32_t>::max()) return "there are too many nodes";
  if (tree.descriptors.size() != count || tree.weights.size() != count ||
      (!tree.ids.empty() && tree.ids.size() != count)) {
    return "its arrays differ in length";
  }
  return std::nullopt;
}

// Visits the arrays level by level: the children of level [begin, end) are the next level.
std::optional<std::string> ProblemOfLevels(const VocabularyTree& tree) {
  const std::size_t count = tree.num_children.size();
  std::size_t begin = 0;
  std::size_t end = 1;
  for (int level = 0; begin < end; ++level) {
    if (level > tree.depth) return "it has more levels than its depth says";
    std::size_t next_end = end;
    for (std::size_t place = begin; place < end; ++place) {
      if (tree.num_children[place] > tree.branching) return "a node has too many children";
      next_end += tree.num_children[place];
    }
    if (next_end > count) return "children are missing";
    begin = end;
    end = next_end;
  }
  if (end != count) return "there are nodes without a parent";
  return std::nullopt;
}

std::optional<std::string> ProblemOfWeights(const VocabularyTree& tree) {
  for (std::size_t place = 0; place < tree.weights.size(); ++place) {
    const float weight = tree.weights[place];
    if (!std::isfinite(weight) || weight < 0.0F) return "a weight is negative or not a number";
    if (tree.num_children[place] > 0 && weight != 0.0F)
      return "a node that is no word has a weight";
  }
  return std::nullopt;
}

std::optional<std::string> ProblemOfIds(const VocabularyTree& tree) {
  if (tree.ids.empty()) return std::nullopt;
  if (tree.ids[0] != 0) return "the root is not node 0";
  std::vector<bool> seen(tree.ids.size());
  for (const std::uint32_t id : tree.ids) {
    if (id >= seen.size() || seen[id]) return "its node numbers are not 0, 1, 2 ... in some order";
    seen[id] = true;
  }
  std::size_t child = 1;
  for (std::size_t place = 0; place < tree.ids.size(); ++place) {
    std::uint32_t before = tree.ids[place];
    for (int k = 0; k < tree.num_children[place]; ++k, ++child) {
      if (tree.ids[child] < before)
        return "a node's number is below its parent's or elder sibling's";
      before = tree.ids[child];
    }
  }
  return std::nullopt;
}

BagOfWords BagOf(std::span<const std::uint32_t> sorted_words, const Vocabulary& vocabulary) {
  const Weighting weighting = vocabulary.tree().weighting;
  const bool once = weighting == Weighting::kIdf || weighting == Weighting::kBinary;
  BagOfWords bag;
  std::vector<double> weights;
  bag.reserve(sorted_words.size());
  weights.reserve(sorted_words.size());
  for (auto begin = sorted_words.begin(); begin != sorted_words.end();) {
    const auto end = std::upper_bound(begin, sorted_words.end(), *begin);
    const double times = once ? 1.0 : static_cast<double>(end - begin);
    bag.push_back({*begin, 0.0F});
    weights.push_back(times * vocabulary.WeightOf(*begin));
    begin = end;
  }
  const double sum = std::accumulate(weights.begin(), weights.end(), 0.0);
  for (std::size_t k = 0; k < bag.size(); ++k) {
    bag[k].weight = static_cast<float>(weights[k] / sum);
  }
  return bag;
}

// From (node, feature) pairs, sorted.
DirectIndex IndexOf(std::span<const std::pair<std::uint32_t, std::uint16_t>> features_by_node) {
  DirectIndex index;
  index.features.reserve(features_by_node.size());
  for (const auto& [node, feature] : features_by_node) {
    if (index.nodes.empty() || index.nodes.back() != node) {
      index.nodes.push_back(node);
      index.starts.push_back(static_cast<std::uint32_t>(index.features.size()));
    }
    index.features.push_back(feature);
  }
  if (!index.nodes.empty()) {
    index.starts.push_back(static_cast<std::uint32_t>(index.features.size()));
  }
  index.nodes.shrink_to_fit();
  index.starts.shrink_to_fit();
  return index;
}

}  // namespace

const char* Name(Weighting weighting) {
  switch (weighting) {
    case Weighting::kTfIdf:
      return "TF_IDF";
    case Weighting::kTf:
      return "TF";
    case Weighting::kIdf:
      return "IDF";
    case Weighting::kBinary:
      return "BINARY";
  }
  throw std::invalid_argument("Name: not a weighting");
}

double Score(const BagOfWords& a, const BagOfWords& b) {
  double score = 0.0;
  auto in_a = a.begin();
  auto in_b = b.begin();
  while (in_a != a.end() && in_b != b.end()) {
    if (in_a->word < in_b->word) {
      ++in_a;
    } else if (in_b->word < in_a->word) {
      ++in_b;
    } else {
      score += std::min(in_a->weight, in_b->weight);
      ++in_a;
      ++in_b;
    }
  }
  return score;
}

std::optional<std::string> VocabularyTree::Problem() const {
  if (auto problem = ProblemOfShape(*this)) return problem;
  if (auto problem = ProblemOfLevels(*this)) return problem;
  if (auto problem = ProblemOfWeights(*this)) return problem;
  return ProblemOfIds(*this);
}

Vocabulary::Vocabulary(VocabularyTree tree) : tree_(std::move(tree)) {
  if (const std::optional<std::string> problem = tree_.Problem()) {
    throw std::invalid_argument("Vocabulary: " + *problem);
  }
  const std::size_t count = tree_.num_children.size();
  nodes_.resize(count);
  // Words are numbered by the ids of the leaves; `places` is the inverse of `ids`.
  std::vector<std::uint32_t> places(tree_.ids.size());
  for (std::size_t place = 0; place < places.size(); ++place) {
    places[tree_.ids[place]] = static_cast<std::uint32_t>(place);
  }
  std::uint32_t next_child = 1;
  for (std::size_t place = 0; place < count; ++place) {
    nodes_[place] = {tree_.num_children[place], next_child};
    next_child += tree_.num_children[place];
  }
  word_weights_.reserve(count);
  for (std::size_t id = 0; id < count; ++id) {
    const std::size_t place = places.empty() ? id : places[id];
    if (nodes_[place].num_children > 0) continue;
    nodes_[place].first_child = static_cast<std::uint32_t>(word_weights_.size());
    word_weights_.push_back(tree_.weights[place]);
  }
  word_weights_.shrink_to_fit();
}

// Distance and number of a child in one integer: the minimum is the first of the nearest, without
// unpredictable branches.
std::uint32_t Vocabulary::NearestChild(const Node& node, const BinaryDescriptor& descriptor) const {
  const BinaryDescriptor* children = tree_.descriptors.data() + node.first_child;
  std::uint32_t nearest = ~std::uint32_t{0};
  for (std::uint32_t k = 0; k < node.num_children; ++k) {
    const auto distance = static_cast<std::uint32_t>(HammingDistance(children[k], descriptor));
    nearest = std::min(nearest, distance << 8 | k);
  }
  return node.first_child + (nearest & 0xFFU);
}

std::uint32_t Vocabulary::IdOf(std::uint32_t place) const {
  return tree_.ids.empty() ? place : tree_.ids[place];
}

std::uint32_t Vocabulary::WordOf(const BinaryDescriptor& descriptor) const {
  std::uint32_t place = 0;
  while (nodes_[place].num_children > 0) place = NearestChild(nodes_[place], descriptor);
  return nodes_[place].first_child;
}

void Vocabulary::Walk(std::span<const BinaryDescriptor> descriptors,
                      int index_level,
                      std::span<Step> steps) const {
  std::fill(steps.begin(), steps.end(), Step{});
  for (int level = 1; level <= tree_.depth; ++level) {
    for (std::size_t k = 0; k < descriptors.size(); ++k) {
      const Node& node = nodes_[steps[k].place];
      if (node.num_children == 0) continue;
      const std::uint32_t child = NearestChild(node, descriptors[k]);
      steps[k].place = child;
      if (level <= index_level) steps[k].index_place = child;
      __builtin_prefetch(&nodes_[child]);
    }
    for (const Step& step : steps) {
      const Node& node = nodes_[step.place];
      if (node.num_children == 0) continue;
      const BinaryDescriptor* children = tree_.descriptors.data() + node.first_child;
      for (std::uint32_t k = 0; k < node.num_children; k += 2) __builtin_prefetch(children + k);
    }
  }
}

ImageWords Vocabulary::Transform(std::span<const BinaryDescriptor> descriptors,
                                 int levels_up) const {
  if (descriptors.size() > kMaxDescriptors) {
    throw std::invalid_argument("Transform: at most 65536 descriptors an image, not " +
                                std::to_string(descriptors.size()));
  }
  if (levels_up < 0) throw std::invalid_argument("Transform: levels_up is negative");
  std::vector<std::uint32_t> words;
  std::vector<std::pair<std::uint32_t, std::uint16_t>> features_by_node;
  words.reserve(descriptors.size());
  features_by_node.reserve(descriptors.size());
  std::array<Step, kBatch> steps;
  for (std::size_t begin = 0; begin < descriptors.size(); begin += kBatch) {
    const auto batch = descriptors.subspan(begin, std::min(kBatch, descriptors.size() - begin));
    Walk(batch, tree_.depth - levels_up, std::span(steps).first(batch.size()));
    for (std::size_t k = 0; k < batch.size(); ++k) {
      const std::uint32_t word = nodes_[steps[k].place].first_child;
      if (word_weights_[word] == 0.0F) continue;
      words.push_back(word);
      features_by_node.emplace_back(IdOf(steps[k].index_place),
                                    static_cast<std::uint16_t>(begin + k));
    }
  }
  std::sort(words.begin(), words.end());
  std::sort(features_by_node.begin(), features_by_node.end());
  return {BagOf(words, *this), IndexOf(features_by_node)};
}

}  // namespace rotslam
