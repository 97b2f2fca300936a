#pragma once

#include <algorithm>
#include <map>

#include "rotodom/types/ids.h"

namespace rotslam {

/// The pieces that edges join views to, as a union-find: between two pieces no way is known.
class Pieces {
 public:
  /// The oldest view of the piece.
  FrameId Of(FrameId view) {
    FrameId root = view;
    for (auto up = parent_.find(root); up != parent_.end(); up = parent_.find(root)) {
      root = up->second;
    }
    if (root != view) parent_[view] = root;
    return root;
  }

  /// False when the two are of one piece already.
  bool Join(FrameId a, FrameId b) {
    a = Of(a);
    b = Of(b);
    if (a == b) return false;
    parent_[std::max(a, b)] = std::min(a, b);
    return true;
  }

 private:
  std::map<FrameId, FrameId> parent_;
};

}  // namespace rotslam
