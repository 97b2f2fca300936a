#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "rotodom/features/binary_descriptor.h"
#include "rotodom/loop/vocabulary.h"

namespace rotslam {

/// Shape of a vocabulary to train, and how long to train it.
struct TrainingOptions {
  // Children of a node, 2 to 255, and levels below the root: branching^depth words at most, fewer
  // where the descriptors run out. 10 and 5 give up to 100,000 words, which take 4 MB; with 10,000
  // words (depth 4) the scores of wrong places come near to those of right ones (0.21 and 0.24 in
  // place of 0.07 and 0.09). ORB-SLAM's vocabulary has 10 and 6.
  int branching = 10;
  int depth = 5;
  // Clusters with fewer descriptors are words and not divided further, which saves bytes: at 20 and
  // 60 the images of the shipped vocabulary give 99,000 and 93,000 words and find places equally
  // well (82.9 and 82.6 % of 7-Scenes kitchen, tests/bench/loop_retrieval.cc).
  int min_descriptors = 20;
  // Rounds of assigning and averaging per cluster; it stops before when nothing changes.
  int max_iterations = 11;
  std::uint64_t seed = 1;

  std::optional<std::string> Problem() const;

  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("branching", branching);
    visit("depth", depth);
    visit("min_descriptors", min_descriptors);
    visit("max_iterations", max_iterations);
    visit("seed", seed);
  }
};

/// Clusters descriptors into a vocabulary with TF_IDF weights, ln(images / images with the word).
/// @param descriptors_by_image  at least two images.
/// @param progress              is told level and depth before each level; may be empty.
/// Throws std::invalid_argument when options.Problem(), when there are fewer than two images, or
/// when all descriptors are equal. The result does not depend on num_threads.
/// Cost:    36 bytes a descriptor beside the input; a million descriptors take some 10 s.
/// Source:  Galvez-Lopez & Tardos, Bags of Binary Words, T-RO 2012, sec. III, for hierarchical
///          k-medians with majority votes; Arthur & Vassilvitskii, k-means++, SODA 2007, for the
///          starts: the Hamming distance is the squared Euclidean distance of bits.
Vocabulary TrainVocabulary(const std::vector<std::vector<BinaryDescriptor>>& descriptors_by_image,
                           const TrainingOptions& options,
                           int num_threads,
                           const std::function<void(int level, int depth)>& progress = {});

}  // namespace rotslam
