#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Geometry>

namespace rotslam {

/// A relative rotation between two positions in a list of views.
struct ConsensusEdge {
  int i = 0;
  int j = 0;
  Eigen::Quaterniond j_from_i = Eigen::Quaterniond::Identity();
  double variance = 0.0;  // of the error, per axis, rad^2
};

struct ConsensusProblem {
  int num_views = 0;
  std::span<const ConsensusEdge> edges;
  // Orientations by view. Those of views with `is_held` are fixed; the others are ignored, unless
  // `has_start` says that all are start values. With start values only the trusted edges are
  // determined.
  std::vector<Eigen::Quaterniond> cam_from_world;
  std::vector<char> is_held;
  bool has_start = false;
  // Edges agree when they differ by no more than this many standard deviations.
  double trust_sigmas = 4.0;
  // Ratio of the errors along paths to those of independent edges.
  double drift_factor = 1.0;
  std::uint64_t seed = 1;  // of random trees
};

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
