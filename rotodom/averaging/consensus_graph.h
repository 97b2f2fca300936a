#pragma once

#include <span>
#include <vector>

#include <Eigen/Geometry>

#include "rotodom/averaging/consensus_problem.h"

namespace rotslam {

/// Square of twice the sine of half the angle: the angle's square while it is small.
inline double SquaredAngle(const Eigen::Quaterniond& q) { return 4.0 * q.vec().squaredNorm(); }

/// Largest tolerance at which agreement is evidence: one random rotation in a thousand agrees by
/// chance.
constexpr double kLargestEvidence_rad = 0.25;
inline bool IsEvidence(double squared_tolerance) {
  return squared_tolerance < kLargestEvidence_rad * kLargestEvidence_rad;
}

/// Classification of an edge by cycles.
enum class EdgeVerdict : char { kUnknown, kContradicted, kConfirmed };

/// The edges of a ConsensusProblem by view. The problem must outlive it.
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
  /// The edge's rotation in the direction that starts at view `from`.
  Eigen::Quaterniond Along(int edge, int from) const {
    const ConsensusEdge& e = problem_.edges[edge];
    return e.i == from ? e.j_from_i : e.j_from_i.conjugate();
  }
  /// Squared angle within which two rotations agree whose difference has this variance per axis.
  double Tolerance(double variance) const {
    return problem_.trust_sigmas * problem_.trust_sigmas * variance;
  }
  /// Connected components of the graph, by view, numbered by their first views.
  std::vector<int> Components() const;

 private:
  const ConsensusProblem& problem_;
  std::vector<int> first_;
  std::vector<Neighbour> neighbours_;  // by view, then by neighbour
};

/// Classifies edges by triangles and cycles of four: whether the rotations around them compose to
/// the identity.
/// Cost:    O(E degree^2) at most for E edges.
std::vector<EdgeVerdict> ClassifyByShortCycles(const ConsensusGraph& graph, int num_threads);

}  // namespace rotslam
