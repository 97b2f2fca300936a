#include "rotodom/loop/training.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <random>
#include <set>
#include <stdexcept>
#include <vector>

#include <gtest/gtest.h>

#include "rotodom/loop/vocabulary_file.h"
#include "tests/rotodom/loop/random_vocabulary.h"

namespace rotslam {
namespace {

struct Copies {
  std::vector<BinaryDescriptor> centers;
  std::vector<std::vector<BinaryDescriptor>> images;
};

// Image k shows `per_center` noisy copies of every center but the first k % num_centers.
Copies NoisyCopies(int num_centers, int num_images, int per_center, int noise_bits) {
  std::mt19937_64 random(3);
  Copies copies;
  copies.centers = RandomDescriptors(num_centers, 5);
  for (int image = 0; image < num_images; ++image) {
    auto& descriptors = copies.images.emplace_back();
    for (int center = image % num_centers; center < num_centers; ++center) {
      for (int k = 0; k < per_center; ++k) {
        descriptors.push_back(Noisy(copies.centers[center], noise_bits, random));
      }
    }
  }
  return copies;
}

TEST(TrainVocabulary, SeparatesNoisyCopies) {
  const Copies copies = NoisyCopies(8, 8, 20, 10);
  TrainingOptions options;
  options.branching = 8;
  options.depth = 1;
  const Vocabulary vocabulary = TrainVocabulary(copies.images, options, 1);
  ASSERT_EQ(vocabulary.num_words(), 8);
  std::set<std::uint32_t> words;
  for (int center = 0; center < 8; ++center) {
    const std::uint32_t word = vocabulary.WordOf(copies.centers[center]);
    words.insert(word);
    // The majority of the copies is the center itself.
    EXPECT_LE(HammingDistance(vocabulary.tree().descriptors[1 + word], copies.centers[center]), 1);
    // Center k is in images 0 to k.
    EXPECT_NEAR(vocabulary.WeightOf(word), std::log(8.0 / (center + 1)), 1e-6);
  }
  EXPECT_EQ(words.size(), 8U);
}

// A fifth of the bits of each copy are wrong; a third of the copies agree on a wrong one now and
// then, half of them do not.
TEST(TrainVocabulary, AveragesByMajority) {
  const Copies copies = NoisyCopies(2, 2, 30, 55);
  TrainingOptions options;
  options.branching = 2;
  options.depth = 1;
  const Vocabulary vocabulary = TrainVocabulary(copies.images, options, 1);
  for (const BinaryDescriptor& center : copies.centers) {
    const std::uint32_t word = vocabulary.WordOf(center);
    EXPECT_LE(HammingDistance(vocabulary.tree().descriptors[1 + word], center), 2);
  }
}

TEST(TrainVocabulary, SeparatesThemOverSeveralLevels) {
  const Copies copies = NoisyCopies(60, 5, 30, 12);
  TrainingOptions options;
  options.branching = 3;
  options.depth = 6;
  options.min_descriptors = 60;
  const Vocabulary vocabulary = TrainVocabulary(copies.images, options, 1);
  EXPECT_EQ(vocabulary.tree().Problem(), std::nullopt);
  std::map<std::uint32_t, int> centers_of_word;
  for (const BinaryDescriptor& center : copies.centers)
    ++centers_of_word[vocabulary.WordOf(center)];
  EXPECT_GT(centers_of_word.size(), 45U);
  // Fresh copies come to the words of their centers.
  std::mt19937_64 random(8);
  int num_same = 0;
  for (int k = 0; k < 600; ++k) {
    const BinaryDescriptor& center = copies.centers[k % 60];
    num_same += vocabulary.WordOf(Noisy(center, 12, random)) == vocabulary.WordOf(center);
  }
  EXPECT_GT(num_same, 540);
}

TEST(TrainVocabulary, GivesTheSameBytesWithAnyNumberOfThreads) {
  const Copies copies = NoisyCopies(200, 12, 3, 60);
  TrainingOptions options;
  options.depth = 3;
  const std::string one = EncodeBinary(TrainVocabulary(copies.images, options, 1));
  EXPECT_EQ(EncodeBinary(TrainVocabulary(copies.images, options, 2)), one);
  EXPECT_EQ(EncodeBinary(TrainVocabulary(copies.images, options, 5)), one);
  options.seed = 2;
  EXPECT_NE(EncodeBinary(TrainVocabulary(copies.images, options, 1)), one);
}

TEST(TrainVocabulary, MakesOneWordOfEqualDescriptors) {
  const std::vector<BinaryDescriptor> centers = RandomDescriptors(3, 1);
  std::vector<std::vector<BinaryDescriptor>> images(2);
  for (int k = 0; k < 90; ++k) images[k % 2].push_back(centers[k % 3]);
  const Vocabulary vocabulary = TrainVocabulary(images, {}, 1);
  EXPECT_EQ(vocabulary.num_words(), 3);
  EXPECT_EQ(vocabulary.tree().depth, 5);
}

TEST(TrainVocabulary, StopsAtSmallClusters) {
  const std::vector<std::vector<BinaryDescriptor>> images = {RandomDescriptors(500, 1),
                                                             RandomDescriptors(500, 2)};
  TrainingOptions options;
  options.min_descriptors = 101;
  const VocabularyTree tree = TrainVocabulary(images, options, 1).tree();
  options.min_descriptors = 2;
  const int num_words = TrainVocabulary(images, options, 1).num_words();
  EXPECT_GT(num_words, 800);
  EXPECT_LT(static_cast<int>(tree.num_children.size()), num_words / 4);
}

TEST(TrainVocabulary, RefusesWhatCannotBeDivided) {
  const std::vector<BinaryDescriptor> same(50, BinaryDescriptor{});
  EXPECT_THROW(TrainVocabulary({same, same}, {}, 1), std::invalid_argument);
  EXPECT_THROW(TrainVocabulary({RandomDescriptors(50, 1)}, {}, 1), std::invalid_argument);
  EXPECT_THROW(TrainVocabulary({{}, {}}, {}, 1), std::invalid_argument);
  TrainingOptions options;
  options.branching = 1;
  EXPECT_EQ(options.Problem(), "branching is 1, must be 2 to 255");
  EXPECT_THROW(TrainVocabulary({RandomDescriptors(50, 1), RandomDescriptors(50, 2)}, options, 1),
               std::invalid_argument);
  options = {};
  options.depth = 21;
  EXPECT_EQ(options.Problem(), "depth is 21, must be 1 to 20");
  options = {};
  options.min_descriptors = 1;
  EXPECT_EQ(options.Problem(), "min_descriptors is 1, must be at least 2");
  options = {};
  options.max_iterations = -1;
  EXPECT_EQ(options.Problem(), "max_iterations is -1, must be zero or more");
}

}  // namespace
}  // namespace rotslam
