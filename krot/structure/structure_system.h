#pragma once

#include <memory>
#include <vector>

#include <Eigen/Core>

#include "krot/structure/minimax_problem.h"

namespace rotslam {

/// Three unknowns per centre (all but view 0), then three per point.
struct StructureLayout {
  int num_views;
  int num_points;
  int Center(int view) const { return 3 * (view - 1); }  // negative for view 0
  int Point(int point) const { return 3 * (num_views - 1) + 3 * point; }
  int size() const { return 3 * (num_views - 1) + 3 * num_points; }
};

/// A problem's observations point by point.
struct PointGroups {
  std::vector<int> begin;         // of point i in `observations`; begin[num_points] is the end
  std::vector<int> observations;  // positions in MinimaxProblem::observations

  explicit PointGroups(const MinimaxProblem& problem);
};

class CameraSystem;

/// Linear systems with the structure of bundle adjustment. Fixed views and points have entries in
/// the vectors, and zeros in the solutions. H is the sum over the observations of (X - c) -> S (X -
/// c) with 3 x 3 positive semidefinite S. Points are eliminated one by one; the system of the
/// centres is factored in tiles, of which only the non-zero ones are stored.
/// Cost:    sum of squared track lengths to assemble; the centres' factor is linear in the views
///          for a drive, cubic where every two views share points.
class StructureSystem {
 public:
  explicit StructureSystem(const MinimaxProblem& problem);
  ~StructureSystem();
  StructureSystem(const StructureSystem&) = delete;
  StructureSystem& operator=(const StructureSystem&) = delete;

  /// Assembles and factors H plus a damping at the level of rounding, increased until H is positive
  /// definite in double arithmetic. False when the damping would become too large.
  /// @param S  one per observation, in the problem's order.
  bool Factor(const std::vector<Eigen::Matrix3d>& S);

  /// H^-1 b in the order of StructureLayout. Call after Factor() with the same `S`.
  Eigen::VectorXd Solve(const std::vector<Eigen::Matrix3d>& S, const Eigen::VectorXd& b) const;

 private:
  void EliminatePoints(const std::vector<Eigen::Matrix3d>& S, double damping);

  StructureLayout layout_;
  PointGroups groups_;
  std::vector<int> view_of_;  // of each observation, in the groups' order; 0 for a fixed one
  std::vector<int> fixed_views_;
  std::vector<bool> point_fixed_;
  std::vector<Eigen::Matrix3d> L_point_;
  std::unique_ptr<CameraSystem> cameras_;
};

}  // namespace rotslam
