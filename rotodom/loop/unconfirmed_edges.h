#pragma once

#include <utility>
#include <vector>

#include "rotodom/loop/verification.h"
#include "rotodom/types/disjoint_sets.h"

namespace rotslam {

/// Edges between two components of the view-graph that no second old place confirms. Edges of other
/// frames may confirm them: each measures the rotation between the components, and only right edges
/// agree.
class UnconfirmedEdges {
 public:
  explicit UnconfirmedEdges(const VerificationOptions& options) : options_(options) {}

  void Add(EdgeWithMatches connection) { unconfirmed_.push_back(std::move(connection)); }

  /// Removes these edges.
  void Remove(const std::vector<EdgeWithMatches>& connections);

  /// The unconfirmed edges that agree with `connection` on the rotation between the components to
  /// options.max_cycle_deg, and `connection` itself, the most certain one first. Empty unless they
  /// are at least options.min_edges, at frames whose directions differ by options.min_witness_deg,
  /// with options.sure_inliers matches in all.
  /// @param cam_from_world  present orientations of all views.
  /// @param pieces          components by frame; `connection` links two of them.
  std::vector<EdgeWithMatches> Confirmed(const EdgeWithMatches& connection,
                                         const RotationMap& cam_from_world,
                                         const DisjointSets& pieces) const;

 private:
  VerificationOptions options_;
  std::vector<EdgeWithMatches> unconfirmed_;
};

}  // namespace rotslam
