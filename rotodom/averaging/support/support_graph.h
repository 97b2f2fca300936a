#pragma once

#include <algorithm>
#include <cstddef>
#include <functional>
#include <span>
#include <vector>

#include "rotodom/types/view_graph.h"

namespace rotslam {

/// A view at the other end of an edge.
struct SupportNeighbour {
  int view = 0;
  int edge = 0;
};

/// The graph of some of the edges, its views by position.
struct SupportGraph {
  std::vector<FrameId> ids;  // ascending
  std::vector<std::vector<SupportNeighbour>> neighbours;

  int PositionOf(FrameId id) const {
    return static_cast<int>(std::lower_bound(ids.begin(), ids.end(), id) - ids.begin());
  }
  int size() const { return static_cast<int>(ids.size()); }
};

/// @param counts  whether an edge, by its position in `edges`, belongs to the graph. Views whose
/// edges
///                do not are in it all the same.
SupportGraph MakeSupportGraph(std::span<const RelativeRotation> edges,
                              const std::function<bool(std::size_t)>& counts);

/// A depth-first walk over a graph.
struct GraphWalk {
  std::vector<int> order;        // of the views
  std::vector<int> parent;       // -1 at roots
  std::vector<int> parent_edge;  // -1 at roots
  std::vector<int> low;          // the earliest place in the order that the subtree reaches
  std::vector<int> place;        // in the order
  std::vector<int> root;
};

GraphWalk WalkGraph(const SupportGraph& graph);

}  // namespace rotslam
