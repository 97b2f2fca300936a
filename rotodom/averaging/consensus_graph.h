#pragma once

#include <span>
#include <vector>

#include <Eigen/Geometry>

#include "rotodom/averaging/consensus_problem.h"

namespace rotslam {

/// Square of twice the sine of half the angle: the angle's square while it is small.
inline double SquaredAngle(const Eigen::Quaterniond& q) { return 4.0 * q.vec().squaredNorm(); }

/// Beyond this tolerance agreement is no evidence: one rotation at random in a thousand agrees.
constexpr double kLargestEvidence_rad = 0.25;
inline bool IsEvidence(double squared_tolerance) {
  return squared_tolerance < kLargestEvidence_rad * kLargestEvidence_rad;
}

/// What cycles say of an edge.
enum class EdgeVerdict : char { kUnknown, kContradicted, kConfirmed };

/// The edges of a ConsensusProblem, which must outlive it, by view.
class ConsensusGraph {
 public:
  struct Neighbour {
    int view;
    int edge;
  };

  explicit ConsensusGraph(const ConsensusProblem& problem);

  const ConsensusProblem& problem() const { return problem_; }
  int num_views() const { return problem_.num_views; }
  int num_edges() const { return static_cast<int>(problem_.edges.size()); }
  const ConsensusEdge& edge(int index) const { return problem_.edges[index]; }
  /// Ascending.
  std::span<const Neighbour> NeighboursOf(int view) const {
    return {neighbours_.data() + first_[view],
            static_cast<std::size_t>(first_[view + 1] - first_[view])};
  }
  /// The edge's rotation, read from view `from`.
  Eigen::Quaterniond Along(int edge, int from) const {
    const ConsensusEdge& e = problem_.edges[edge];
    return e.i == from ? e.j_from_i : e.j_from_i.conjugate();
  }
  /// Square of the angle within which rotations agree whose difference has this variance per axis.
  double Tolerance(double variance) const {
    return problem_.trust_sigmas * problem_.trust_sigmas * variance;
  }
  /// Connected pieces of the graph, by view, numbered by their first views.
  std::vector<int> Components() const;

 private:
  const ConsensusProblem& problem_;
  std::vector<int> first_;
  std::vector<Neighbour> neighbours_;  // by view, then by neighbour
};

/// Edges that close triangles or cycles of four with the identity, and edges that do not.
/// Cost:    O(E degree^2) at most for E edges.
std::vector<EdgeVerdict> JudgeByShortCycles(const ConsensusGraph& graph, int num_threads);

}  // namespace rotslam
