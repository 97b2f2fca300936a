#pragma once

#include <span>
#include <vector>

#include <Eigen/Geometry>

#include "rotodom/averaging/consensus_graph.h"

namespace rotslam {

/// State of the edges and views of a ConsensusGraph.
struct EdgeKnowledge {
  std::vector<EdgeVerdict> verdict;  // by edge
  std::vector<int> piece;            // by view: component over confirmed edges
  bool IsConfirmed(int edge) const { return verdict[edge] == EdgeVerdict::kConfirmed; }
};

/// Shortest paths from the roots to all views: as few unconfirmed edges as possible, then least
/// variance. A path enters each group of confirmed views once, since confirmed edges relate its
/// views.
class ConsensusTree {
 public:
  /// @param trial  0 for the shortest paths; other values weight unconfirmed edges at random.
  /// Cost:         O(E log E) for E edges.
  ConsensusTree(const ConsensusGraph& graph,
                const EdgeKnowledge& knowledge,
                const std::vector<int>& roots,
                int trial);

  bool Has(int edge) const {
    const ConsensusEdge& e = graph_.edge(edge);
    return nodes_[e.i].edge == edge || nodes_[e.j].edge == edge;
  }
  int ParentOf(int view) const { return nodes_[view].parent; }
  int EdgeAbove(int view) const { return nodes_[view].edge; }
  int DepthOf(int view) const { return nodes_[view].depth; }
  /// -1 when the two have different roots.
  int CommonAncestor(int a, int b) const;
  /// Variance of the rotation between two views along the tree, per axis, rad^2.
  double PathVariance(int a, int b) const;
  /// Replaces orientations by those along the tree. Fixed roots keep theirs, other roots get the
  /// identity.
  void Chain(std::vector<Eigen::Quaterniond>& cam_from_world) const;

 private:
  struct Node {
    int parent = -1;
    int edge = -1;
    int depth = 0;
    int jump = 0;  // an ancestor, for paths in logarithmic time
    double variance = 0.0;
  };

  void Settle(int view, int edge);

  const ConsensusGraph& graph_;
  std::vector<Node> nodes_;
  std::vector<int> order_;  // views, parents first
};

}  // namespace rotslam
