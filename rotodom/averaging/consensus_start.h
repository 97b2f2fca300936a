#pragma once

#include <vector>

#include <Eigen/Geometry>

#include "rotodom/averaging/consensus_problem.h"

namespace rotslam {

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
