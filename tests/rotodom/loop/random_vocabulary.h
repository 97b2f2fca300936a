#pragma once

#include <cstdint>
#include <random>
#include <vector>

#include "rotodom/loop/vocabulary.h"

namespace rotslam {

inline BinaryDescriptor RandomDescriptor(std::mt19937_64& random) {
  return {random(), random(), random(), random()};
}

/// The descriptor with some of its bits turned, the same one perhaps twice.
inline BinaryDescriptor Noisy(BinaryDescriptor descriptor, int bits, std::mt19937_64& random) {
  for (int k = 0; k < bits; ++k) {
    const std::uint64_t bit = random() % 256;
    descriptor[bit / 64] ^= std::uint64_t{1} << (bit % 64);
  }
  return descriptor;
}

inline std::vector<BinaryDescriptor> RandomDescriptors(int count, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::vector<BinaryDescriptor> descriptors;
  for (int k = 0; k < count; ++k) descriptors.push_back(RandomDescriptor(random));
  return descriptors;
}

/// A tree in which every fifth node above the last level is a word; a tenth of the words weigh
/// nothing. Branching is at least 3.
inline VocabularyTree RandomTree(int branching, int depth, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  VocabularyTree tree;
  tree.branching = branching;
  tree.depth = depth;
  std::size_t begin = 0;
  std::size_t end = 1;
  for (int level = 0; level <= depth; ++level) {
    std::size_t next_end = end;
    for (std::size_t place = begin; place < end; ++place) {
      const bool is_leaf = level == depth || (place > 0 && random() % 5 == 0);
      const int count = is_leaf ? 0 : branching - static_cast<int>(random() % 3);
      tree.num_children.push_back(static_cast<std::uint8_t>(count));
      tree.descriptors.push_back(place == 0 ? BinaryDescriptor{} : RandomDescriptor(random));
      const auto weight = static_cast<float>(random() % 10);
      tree.weights.push_back(is_leaf ? weight : 0.0F);
      next_end += count;
    }
    begin = end;
    end = next_end;
  }
  return tree;
}

/// Numbers the nodes as DBoW2 does: the children of a node side by side, then those of the first
/// child, and of its first child.
inline void NumberDepthFirst(VocabularyTree& tree) {
  std::vector<std::size_t> first_children(tree.num_children.size());
  std::size_t next = 1;
  for (std::size_t place = 0; place < tree.num_children.size(); ++place) {
    first_children[place] = next;
    next += tree.num_children[place];
  }
  tree.ids.assign(tree.num_children.size(), 0);
  std::uint32_t next_id = 1;
  std::vector<std::size_t> open = {0};
  while (!open.empty()) {
    const std::size_t place = open.back();
    open.pop_back();
    for (int k = 0; k < tree.num_children[place]; ++k) {
      tree.ids[first_children[place] + k] = next_id++;
    }
    for (int k = tree.num_children[place] - 1; k >= 0; --k) {
      open.push_back(first_children[place] + k);
    }
  }
}

}  // namespace rotslam
