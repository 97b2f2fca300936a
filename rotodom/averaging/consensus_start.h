#pragma once

#include <vector>

#include <Eigen/Geometry>

#include "rotodom/averaging/consensus_problem.h"

namespace rotslam {

struct ConsensusStart {
  std::vector<Eigen::Quaterniond> cam_from_world;
  std::vector<int> component;  // by view, numbered by their first views
  // Roots of the tree: for each component the fixed views, or the view with the most confirmed
  // edges.
  std::vector<int> roots;
  // By edge: whether it agrees with the start, allowing for drift along the tree between its ends.
  std::vector<char> is_trusted;
};

/// Finds start orientations along a spanning tree of edges that cycles of other edges confirm, so
/// that wrong edges are left out.
///
/// 1. An edge is confirmed if it closes a triangle, or else a cycle of four, with the identity;
///    wrong edges rarely do so by chance.
/// 2. The tree of shortest paths is built: as few unconfirmed edges as possible, then least
///    variance.
/// 3. An edge outside the tree that agrees with it confirms its whole cycle. Several edges between
///    two groups of confirmed views are confirmed where they agree on the rotation between the
///    groups. Steps 2 and 3 are repeated until no edge is confirmed, with random choices of
///    unconfirmed edges.
/// 4. Where many edges contradict the result, 2 and 3 are repeated with other trees, and the tree
///    with the fewest contradictions is kept.
///
/// In a component of the graph without a fixed view the root is at the identity.
/// Cost:    O(E log E) a round for E edges, some five rounds, up to five times that below 10,000
///          edges; cycles O(E degree^2) at most.
/// Source:  Zach et al., Disambiguating Visual Relations Using Loop Constraints, CVPR 2010, for the
///          confirmation by cycles; groups of confirmed views and votes between them are ours.
ConsensusStart FindConsensusStart(const ConsensusProblem& problem, int num_threads);

}  // namespace rotslam
