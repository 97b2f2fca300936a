#pragma once

#include <map>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "rotodom/types/ids.h"
#include "rotodom/types/rotation.h"

namespace rotslam {

/// A measured relative rotation between two views: an edge of the view-graph.
struct RelativeRotation {
  FrameId i;
  FrameId j;
  Rotation j_from_i;
  // Covariance of the error delta in `Exp(delta) * j_from_i`, rad^2, in the frame of camera j.
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();
  // Direction of the translation in x_j = R x_i + s t, unit; zero for a rotation-only edge.
  Eigen::Vector3d translation_direction = Eigen::Vector3d::Zero();
  int num_inliers = 0;
  bool rotation_only = false;  // the matches give no evidence of a baseline
  // That evidence as a share of what would be enough: one is at the false-alarm rate asked for.
  double baseline_strength = 0.0;
  double noise_px = 0.1;  // standard deviation of the inliers' distance from their epipolar lines
  double parallax_px = 0.0;  // root mean square of the inliers' flow that rotation does not explain
};

/// The same measurement read the other way, (i, j, R) -> (j, i, R^T).
RelativeRotation Flipped(const RelativeRotation& edge);

/// Relative rotations between views. Edges are stored with i < j; one edge per pair.
class ViewGraph {
 public:
  /// Adds an edge, flipping it when i > j; replaces an older edge of the same pair.
  /// Throws std::invalid_argument when i == j or an id is negative.
  void AddEdge(RelativeRotation edge);

  const std::vector<RelativeRotation>& edges() const { return edges_; }
  const RelativeRotation* FindEdge(FrameId a,
                                   FrameId b) const;  // null when there is none; i < j as stored
  /// Positions in edges() of the edges at `view`, oldest first; empty when the view has none.
  const std::vector<int>& EdgesOf(FrameId view) const;

 private:
  std::vector<RelativeRotation> edges_;
  std::map<std::pair<FrameId, FrameId>, int> index_;
  std::map<FrameId, std::vector<int>> edges_of_;
};

}  // namespace rotslam
