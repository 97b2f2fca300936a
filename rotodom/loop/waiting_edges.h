#pragma once

#include <utility>
#include <vector>

#include "rotodom/loop/verification.h"
#include "rotodom/types/disjoint_sets.h"

namespace rotslam {

/// Edges between two pieces of the view-graph that no second old place confirms. Another frame may:
/// each says how one piece is turned against the other, and only right edges say the same.
class WaitingEdges {
 public:
  explicit WaitingEdges(const VerificationOptions& options) : options_(options) {}

  void Add(EdgeWithMatches connection) { waiting_.push_back(std::move(connection)); }

  /// No longer waits for these.
  void Remove(const std::vector<EdgeWithMatches>& connections);

  /// The waiting edges that turn the two pieces against each other as `connection` does, to
  /// options.max_cycle_deg, and itself, the most certain one first: at least options.min_edges,
  /// at frames that differ by options.min_witness_deg, with options.sure_inliers matches in all;
  /// else none.
  /// @param cam_from_world  present orientations of all views.
  /// @param pieces          by frame; `connection` links two of them.
  std::vector<EdgeWithMatches> Confirmed(const EdgeWithMatches& connection,
                                         const RotationMap& cam_from_world,
                                         const DisjointSets& pieces) const;

 private:
  VerificationOptions options_;
  std::vector<EdgeWithMatches> waiting_;
};

}  // namespace rotslam
