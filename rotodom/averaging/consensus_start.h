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
  // Orientations to keep, by view; views that are not `is_held` ignore theirs. With `has_start` all
  // orientations are a start: then nothing but the trust in edges is found.
  std::vector<Eigen::Quaterniond> cam_from_world;
  std::vector<char> is_held;
  bool has_start = false;
  // Edges agree when they differ by no more than this many standard deviations.
  double trust_sigmas = 4.0;
  // Errors along paths are this many times what independent errors of their edges add up to.
  double drift_factor = 1.0;
  std::uint64_t seed = 1;  // of the trees tried at random
};

struct ConsensusStart {
  std::vector<Eigen::Quaterniond> cam_from_world;
  std::vector<int> component;  // by view, numbered by their first views
  // Where the tree begins, one view or the held ones per component; its best confirmed views.
  std::vector<int> roots;
  // By edge: whether it agrees with the start, drift along the tree between its ends considered.
  std::vector<char> is_trusted;
};

/// Orientations along a spanning tree whose edges are confirmed by cycles of others, so that wrong
/// edges do not enter it.
///
/// 1. Short cycles: an edge that closes a triangle, or else a cycle of four, with the identity is
///    confirmed: wrong edges do so by chance alone, which is rare.
/// 2. A tree of shortest paths over as few unconfirmed edges as possible, then of least variance.
/// 3. An edge outside the tree that agrees with it confirms its whole cycle; and where several
///    edges between two confirmed pieces agree on how the pieces lie to each other, they are
///    confirmed. Back to 2 until nothing new is, other unconfirmed edges tried at random.
/// 4. Where many edges contradict the outcome, 2 and 3 are begun anew with other trees, and the one
///    that fewest contradict is kept.
///
/// Every piece of the graph without a held view gets a root of its own at the identity.
/// Cost:    O(E log E) a round for E edges, some five rounds, up to five times that below 10,000
///          edges; cycles O(E degree^2) at most.
/// Source:  the idea of confirming by cycles is Zach et al., Disambiguating Visual Relations Using
///          Loop Constraints, CVPR 2010; pieces and votes between them are ours.
ConsensusStart FindConsensusStart(const ConsensusProblem& problem, int num_threads);

}  // namespace rotslam
