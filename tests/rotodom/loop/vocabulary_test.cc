#include "rotodom/loop/vocabulary.h"

#include <array>
#include <cstring>
#include <limits>
#include <map>
#include <random>
#include <set>
#include <stdexcept>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "rotodom/loop/default_vocabulary.h"
#include "tests/rotodom/loop/random_vocabulary.h"

namespace rotslam {
namespace {

constexpr std::uint64_t kOnes = ~std::uint64_t{0};
constexpr BinaryDescriptor kNone = {0, 0, 0, 0};
constexpr BinaryDescriptor kQuarter = {kOnes, 0, 0, 0};
constexpr BinaryDescriptor kAll = {kOnes, kOnes, kOnes, kOnes};

// Two levels: node 1 (no bits) with the words 3 (no bits) and 4 (a quarter); node 2 (all bits),
// itself a word.
VocabularyTree SmallTree(Weighting weighting) {
  VocabularyTree tree;
  tree.branching = 2;
  tree.depth = 2;
  tree.weighting = weighting;
  tree.num_children = {2, 2, 0, 0, 0};
  tree.descriptors = {kNone, kNone, kAll, kNone, kQuarter};
  tree.weights = {0.0F, 0.0F, 0.5F, 1.0F, 2.0F};
  return tree;
}

const std::vector<BinaryDescriptor> kImage = {kNone, kAll, kQuarter, kNone};

void ExpectBag(const BagOfWords& bag, const std::vector<std::pair<std::uint32_t, double>>& words) {
  ASSERT_EQ(bag.size(), words.size());
  for (std::size_t k = 0; k < bag.size(); ++k) {
    EXPECT_EQ(bag[k].word, words[k].first);
    EXPECT_NEAR(bag[k].weight, words[k].second, 1e-7);
  }
}

TEST(Vocabulary, CountsWordsOrTakesThemOnce) {
  for (const Weighting counting : {Weighting::kTfIdf, Weighting::kTf}) {
    ExpectBag(Vocabulary(SmallTree(counting)).Transform(kImage, 0).bag,
              {{0, 0.5 / 4.5}, {1, 2.0 / 4.5}, {2, 2.0 / 4.5}});
  }
  for (const Weighting once : {Weighting::kIdf, Weighting::kBinary}) {
    ExpectBag(Vocabulary(SmallTree(once)).Transform(kImage, 0).bag,
              {{0, 0.5 / 3.5}, {1, 1.0 / 3.5}, {2, 2.0 / 3.5}});
  }
}

TEST(Vocabulary, ScoresByHand) {
  const Vocabulary vocabulary(SmallTree(Weighting::kTfIdf));
  const std::vector<BinaryDescriptor> other = {kAll, kAll, kNone};
  // {1/9, 4/9, 4/9} and {1/2, 1/2, 0}: half of 7/18 + 1/18 + 8/18 is 4/9.
  EXPECT_NEAR(Score(vocabulary.Transform(kImage, 0).bag, vocabulary.Transform(other, 0).bag),
              1.0 - 4.0 / 9.0,
              1e-6);
}

TEST(Vocabulary, IndexesByTheNodeAbove) {
  const Vocabulary vocabulary(SmallTree(Weighting::kTfIdf));
  const auto index = [&](int levels_up) { return vocabulary.Transform(kImage, levels_up).index; };
  EXPECT_EQ(index(0), (DirectIndex{{2, 3, 4}, {0, 1, 3, 4}, {1, 0, 3, 2}}));
  EXPECT_EQ(index(1), (DirectIndex{{1, 2}, {0, 3, 4}, {0, 2, 3, 1}}));
  EXPECT_EQ(index(2), (DirectIndex{{0}, {0, 4}, {0, 1, 2, 3}}));
  EXPECT_EQ(index(9), index(2));
  EXPECT_THAT(index(0).FeaturesOf(1), testing::ElementsAre(0, 3));
}

TEST(Vocabulary, LeavesOutWordsWithoutWeight) {
  VocabularyTree tree = SmallTree(Weighting::kTfIdf);
  tree.weights[3] = 0.0F;
  const ImageWords words = Vocabulary(tree).Transform(kImage, 0);
  ExpectBag(words.bag, {{0, 0.2}, {2, 0.8}});
  EXPECT_THAT(words.index.features, testing::ElementsAre(1, 2));
}

TEST(Vocabulary, TakesTheFirstOfEquals) {
  const Vocabulary vocabulary(SmallTree(Weighting::kTfIdf));
  const BinaryDescriptor half_way = {kOnes, kOnes, 0, 0};
  EXPECT_EQ(HammingDistance(half_way, kNone), HammingDistance(half_way, kAll));
  EXPECT_EQ(vocabulary.WordOf(half_way), 2U);
  EXPECT_EQ(vocabulary.WordOf({0xFFFFFFFFU, 0, 0, 0}), 1U);
}

TEST(Vocabulary, NumbersWordsByNode) {
  VocabularyTree tree = SmallTree(Weighting::kTfIdf);
  tree.ids = {0, 1, 4, 2, 3};
  const Vocabulary vocabulary(tree);
  EXPECT_EQ(vocabulary.WordOf(kNone), 0U);
  EXPECT_EQ(vocabulary.WordOf(kQuarter), 1U);
  EXPECT_EQ(vocabulary.WordOf(kAll), 2U);
  EXPECT_EQ(vocabulary.WeightOf(2), 0.5F);
  EXPECT_THAT(vocabulary.Transform(kImage, 1).index.nodes, testing::ElementsAre(1, 4));
}

TEST(Vocabulary, GivesNothingForNothing) {
  const ImageWords words = Vocabulary(SmallTree(Weighting::kTfIdf)).Transform({}, 1);
  EXPECT_TRUE(words.bag.empty());
  EXPECT_EQ(words.index, DirectIndex{});
  EXPECT_EQ(Score(words.bag, words.bag), 0.0);
}

// ---- against a slow, obvious version

struct SlowNode {
  std::uint32_t id = 0;
  int word = -1;
  double weight = 0.0;
  std::array<std::uint8_t, 32> bytes = {};
  std::vector<std::size_t> children;
};

std::vector<SlowNode> SlowNodes(const VocabularyTree& tree) {
  std::vector<SlowNode> nodes(tree.num_children.size());
  std::map<std::uint32_t, std::size_t> leaves;
  std::size_t child = 1;
  for (std::size_t place = 0; place < nodes.size(); ++place) {
    nodes[place].id = tree.ids.empty() ? static_cast<std::uint32_t>(place) : tree.ids[place];
    nodes[place].weight = tree.weights[place];
    std::memcpy(nodes[place].bytes.data(), tree.descriptors[place].data(), 32);
    for (int k = 0; k < tree.num_children[place]; ++k) nodes[place].children.push_back(child++);
    if (nodes[place].children.empty()) leaves[nodes[place].id] = place;
  }
  int word = 0;
  for (const auto& [id, place] : leaves) nodes[place].word = word++;
  return nodes;
}

int SlowDistance(const std::array<std::uint8_t, 32>& a, const BinaryDescriptor& descriptor) {
  std::array<std::uint8_t, 32> b;
  std::memcpy(b.data(), descriptor.data(), 32);
  int distance = 0;
  for (int byte = 0; byte < 32; ++byte) {
    for (int bit = 0; bit < 8; ++bit) distance += (a[byte] >> bit & 1) != (b[byte] >> bit & 1);
  }
  return distance;
}

TEST(Vocabulary, AgreesWithTheSlowVersion) {
  for (const std::uint64_t seed : {1, 2, 3, 4}) {
    SCOPED_TRACE(seed);
    VocabularyTree tree = RandomTree(4, 4, seed);
    if (seed > 2) NumberDepthFirst(tree);
    const Vocabulary vocabulary(tree);
    const std::vector<SlowNode> nodes = SlowNodes(tree);
    const std::vector<BinaryDescriptor> image = RandomDescriptors(500, seed + 100);
    const int levels_up = static_cast<int>(seed);
    std::map<std::uint32_t, double> weights;
    std::map<std::uint32_t, std::vector<std::uint16_t>> features;
    double sum = 0.0;
    for (std::size_t k = 0; k < image.size(); ++k) {
      std::vector<std::size_t> path = {0};
      while (!nodes[path.back()].children.empty()) {
        std::map<int, std::size_t> by_distance;
        for (const std::size_t child : nodes[path.back()].children) {
          by_distance.emplace(SlowDistance(nodes[child].bytes, image[k]), child);
        }
        path.push_back(by_distance.begin()->second);
      }
      const SlowNode& leaf = nodes[path.back()];
      if (leaf.weight == 0.0) continue;
      weights[leaf.word] += leaf.weight;
      sum += leaf.weight;
      const std::size_t level = std::min<std::size_t>(path.size() - 1, 4 - levels_up);
      features[nodes[path[level]].id].push_back(static_cast<std::uint16_t>(k));
    }
    for (auto& [word, weight] : weights) weight /= sum;
    const ImageWords words = vocabulary.Transform(image, levels_up);
    ExpectBag(words.bag, {weights.begin(), weights.end()});
    ASSERT_EQ(words.index.nodes.size(), features.size());
    std::size_t k = 0;
    for (const auto& [node, of_node] : features) {
      EXPECT_EQ(words.index.nodes[k], node);
      EXPECT_THAT(words.index.FeaturesOf(k++), testing::ElementsAreArray(of_node));
    }
  }
}

// ---- laws

TEST(Score, IsSymmetricOneForItselfAndZeroWithoutCommonWords) {
  const Vocabulary vocabulary(RandomTree(5, 3, 7));
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const BagOfWords a = vocabulary.Transform(RandomDescriptors(40, seed), 0).bag;
    const BagOfWords b = vocabulary.Transform(RandomDescriptors(60, seed + 50), 0).bag;
    EXPECT_EQ(Score(a, b), Score(b, a));
    EXPECT_GT(Score(a, b), 0.0);
    EXPECT_LT(Score(a, b), 1.0);
    EXPECT_NEAR(Score(a, a), 1.0, 1e-6);
    std::map<std::uint32_t, double> difference;
    for (const WordWeight& entry : a) difference[entry.word] += entry.weight;
    for (const WordWeight& entry : b) difference[entry.word] -= entry.weight;
    double norm = 0.0;
    for (const auto& [word, value] : difference) norm += std::abs(value);
    EXPECT_NEAR(Score(a, b), 1.0 - 0.5 * norm, 1e-6);
  }
  EXPECT_EQ(Score({{1, 0.5F}, {3, 0.5F}}, {{2, 0.25F}, {4, 0.75F}}), 0.0);
}

// ---- what must fail

TEST(VocabularyTree, NamesWhatIsWrong) {
  EXPECT_EQ(SmallTree(Weighting::kTf).Problem(), std::nullopt);
  const auto problem = [](const std::function<void(VocabularyTree&)>& change) {
    VocabularyTree tree = SmallTree(Weighting::kTf);
    change(tree);
    EXPECT_THROW(Vocabulary{tree}, std::invalid_argument);
    return tree.Problem().value_or("none");
  };
  using testing::HasSubstr;
  EXPECT_THAT(problem([](auto& tree) { tree.branching = 1; }), HasSubstr("branching is 1"));
  EXPECT_THAT(problem([](auto& tree) { tree.depth = 0; }), HasSubstr("depth is 0"));
  EXPECT_THAT(problem([](auto& tree) { tree.depth = 1; }), HasSubstr("more levels"));
  EXPECT_THAT(problem([](auto& tree) { tree.num_children[0] = 3; }), HasSubstr("too many"));
  EXPECT_THAT(problem([](auto& tree) { tree.num_children[3] = 1; }), HasSubstr("missing"));
  EXPECT_THAT(problem([](auto& tree) { tree.num_children[1] = 1; }), HasSubstr("without a parent"));
  EXPECT_THAT(problem([](auto& tree) { tree.num_children[0] = 0; }), HasSubstr("without a parent"));
  EXPECT_THAT(problem([](auto& tree) { tree.weights.pop_back(); }), HasSubstr("length"));
  EXPECT_THAT(problem([](auto& tree) { tree.weights[3] = -1.0F; }), HasSubstr("negative"));
  EXPECT_THAT(
      problem([](auto& tree) { tree.weights[3] = std::numeric_limits<float>::quiet_NaN(); }),
      HasSubstr("not a number"));
  EXPECT_THAT(problem([](auto& tree) { tree.weights[1] = 1.0F; }), HasSubstr("no word"));
  EXPECT_THAT(problem([](auto& tree) { tree.ids = {0, 1, 2, 3, 3}; }), HasSubstr("numbers"));
  EXPECT_THAT(problem([](auto& tree) { tree.ids = {0, 4, 1, 2, 3}; }), HasSubstr("below"));
  EXPECT_THAT(problem([](auto& tree) { tree = VocabularyTree{}; }), HasSubstr("no words"));
}

TEST(Vocabulary, RefusesWhatItCannotIndex) {
  const Vocabulary vocabulary(SmallTree(Weighting::kTfIdf));
  EXPECT_EQ(vocabulary.Transform(std::vector<BinaryDescriptor>(65536, kAll), 0).bag.size(), 1U);
  EXPECT_THROW(vocabulary.Transform(std::vector<BinaryDescriptor>(65537, kAll), 0),
               std::invalid_argument);
  EXPECT_THROW(vocabulary.Transform(kImage, -1), std::invalid_argument);
}

TEST(DefaultVocabulary, IsLargeEnoughToTellPlacesApart) {
  const Vocabulary vocabulary = DefaultVocabulary();
  EXPECT_GT(vocabulary.num_words(), 10000);
  EXPECT_EQ(vocabulary.tree().weighting, Weighting::kTfIdf);
  const BagOfWords bag = vocabulary.Transform(RandomDescriptors(1000, 1), 3).bag;
  EXPECT_GT(bag.size(), 500U);
}

}  // namespace
}  // namespace rotslam
