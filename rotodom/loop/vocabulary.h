#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "rotodom/features/binary_descriptor.h"

namespace rotslam {

/// Weight of a word in an image; the numbers are those of DBoW2's files.
enum class Weighting {
  kTfIdf = 0,   // its weight times the number of its occurrences
  kTf = 1,      // the same with weights of one
  kIdf = 2,     // its weight
  kBinary = 3,  // the same with weights of one
};
/// "TF_IDF", "TF", "IDF" or "BINARY".
const char* Name(Weighting weighting);

/// One word of an image.
struct WordWeight {
  std::uint32_t word = 0;
  float weight = 0.0F;
  bool operator==(const WordWeight&) const = default;
};

/// The words of an image, ascending; their weights are positive and sum to one. Empty for an image
/// without features.
using BagOfWords = std::vector<WordWeight>;

/// Similarity of two images: 1 - |a - b|_1 / 2, 0 without a common word, 1 for equal bags.
/// Error:   1e-6, of the weights as float.
/// Source:  Galvez-Lopez & Tardos, Bags of Binary Words, T-RO 2012, eq. (2); for weights that sum
///          to one it is the sum over common words of the lesser weight.
double Score(const BagOfWords& a, const BagOfWords& b);

/// Features of an image by the vocabulary node of their path, for matching two images node by node.
struct DirectIndex {
  std::vector<std::uint32_t> nodes;     // m node ids, ascending
  std::vector<std::uint32_t> starts;    // m + 1 places in `features`; empty when m is 0
  std::vector<std::uint16_t> features;  // ascending within a node

  /// Features of nodes[k].
  std::span<const std::uint16_t> FeaturesOf(std::size_t k) const {
    return std::span(features).subspan(starts[k], starts[k + 1] - starts[k]);
  }
  bool operator==(const DirectIndex&) const = default;
};

/// An image in words.
struct ImageWords {
  BagOfWords bag;
  DirectIndex index;
};

/// A tree of descriptors as plain arrays of n nodes: the root first, then level by level, the
/// children of each node side by side and in the order of their parents.
struct VocabularyTree {
  int branching = 10;  // children a node has at most, 2 to 255 (DBoW2's k)
  int depth = 6;       // levels below the root at most, 1 to 20 (DBoW2's L)
  Weighting weighting = Weighting::kTfIdf;
  std::vector<std::uint8_t> num_children;
  std::vector<BinaryDescriptor> descriptors;  // the root's is ignored
  std::vector<float> weights;                 // of the leaves; zero at other nodes
  // Node ids, where they differ from the positions in these arrays: 0 to n - 1, below those of the
  // children, which ascend. Empty: the positions.
  std::vector<std::uint32_t> ids;

  /// Reason why this is no such tree, in a few words; nullopt when it is one.
  std::optional<std::string> Problem() const;
};

/// Visual words: a hierarchical clustering of 256-bit descriptors whose leaves are the words,
/// numbered by ascending node id.
/// Source:  Nister & Stewenius, Scalable Recognition with a Vocabulary Tree, CVPR 2006;
///          Galvez-Lopez
///          & Tardos, Bags of Binary Words, T-RO 2012. Words, weights, scores (L1_NORM) and node
///          ids are those of DBoW2 for the same file. Where a branch ends above the level asked
///          for, DBoW2 leaves the node of the direct index undefined; ours is the leaf.
class Vocabulary {
 public:
  /// Throws std::invalid_argument when tree.Problem().
  explicit Vocabulary(VocabularyTree tree);

  /// The words of one image. Each descriptor walks to the nearest child, the first among equals,
  /// until it comes to a leaf. Words of weight zero are left out.
  /// @param descriptors  at most 65536; throws std::invalid_argument for more.
  /// @param levels_up    the direct index is by nodes this many levels above level `depth`; at
  ///                     `depth` or more there is one node, the root.
  /// Cost:    0.7 ms for 2,000 descriptors at branching 10 and depth 5 (tests/bench/loop_bench.cc).
  ImageWords Transform(std::span<const BinaryDescriptor> descriptors, int levels_up) const;

  /// The word of a descriptor.
  std::uint32_t WordOf(const BinaryDescriptor& descriptor) const;
  float WeightOf(std::uint32_t word) const { return word_weights_[word]; }

  int num_words() const { return static_cast<int>(word_weights_.size()); }
  const VocabularyTree& tree() const { return tree_; }

 private:
  struct Node {
    std::uint32_t num_children = 0;
    std::uint32_t first_child = 0;  // its place; of a leaf, its word
  };

  // Position of a descriptor in the tree.
  struct Step {
    std::uint32_t place = 0;
    std::uint32_t index_place = 0;  // on the level of the direct index
  };

  void Walk(std::span<const BinaryDescriptor> descriptors,
            int index_level,
            std::span<Step> steps) const;
  std::uint32_t NearestChild(const Node& node, const BinaryDescriptor& descriptor) const;
  std::uint32_t IdOf(std::uint32_t place) const;

  VocabularyTree tree_;
  std::vector<Node> nodes_;
  std::vector<float> word_weights_;
};

}  // namespace rotslam
