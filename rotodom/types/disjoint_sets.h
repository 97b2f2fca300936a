#pragma once

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <vector>

namespace rotslam {

/// Sets of numbers from 0 on that are joined one by one (union-find). At first every number is a
/// set of its own; the smallest one names the set.
/// Memory: four bytes per number up to the largest one joined.
class DisjointSets {
 public:
  /// @param size  numbers to make room for at once.
  explicit DisjointSets(int size = 0) { Grow(size); }

  /// The name of the number's set.
  /// Cost:    nearly constant, the const one's up to the number of joins.
  int Find(int k) {
    if (k >= Size()) return k;
    while (parent_[k] != k) k = parent_[k] = parent_[parent_[k]];
    return k;
  }
  int Find(int k) const {
    while (k < Size() && parent_[k] != k) k = parent_[k];
    return k;
  }

  /// False when the two are in one set already.
  bool Join(int a, int b) {
    a = Find(a);
    b = Find(b);
    if (a == b) return false;
    Grow(std::max(a, b) + 1);
    parent_[std::max(a, b)] = std::min(a, b);
    return true;
  }

 private:
  int Size() const { return static_cast<int>(parent_.size()); }
  void Grow(int size) {
    if (size <= Size()) return;
    const auto old_size = static_cast<std::ptrdiff_t>(parent_.size());
    parent_.resize(static_cast<std::size_t>(size));
    std::iota(parent_.begin() + old_size, parent_.end(), static_cast<int>(old_size));
  }

  std::vector<int> parent_;
};

}  // namespace rotslam
