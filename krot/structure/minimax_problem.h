#pragma once

#include <vector>

#include <Eigen/Core>

namespace rotslam {

/// One observation of the linear programs: image coordinates with unit focal length.
struct ImageObservation {
  int view = 0;                                  // row of MinimaxProblem::R_c_w
  int point = 0;                                 // 0 .. num_points - 1
  Eigen::Vector2d xy = Eigen::Vector2d::Zero();  // bearing.xy / bearing.z, bearing.z > 0
};

/// The known-rotation problem with dense indices: find centres and points from rotations and image
/// coordinates. View 0 holds the gauge (its centre is the origin).
struct MinimaxProblem {
  std::vector<Eigen::Matrix3d> R_c_w;
  int num_points = 0;
  std::vector<ImageObservation> observations;
  // Views and points that stay where a start has them; empty: none. View 0 stays in any case.
  std::vector<bool> view_fixed;
  std::vector<bool> point_fixed;

  bool ViewFixed(int view) const { return view == 0 || (!view_fixed.empty() && view_fixed[view]); }
  bool PointFixed(int point) const { return !point_fixed.empty() && point_fixed[point]; }
  int num_views() const { return static_cast<int>(R_c_w.size()); }
};

/// An answer to a MinimaxProblem.
struct MinimaxStructure {
  std::vector<Eigen::Vector3d> center_in_world;
  std::vector<Eigen::Vector3d> point_in_world;
};

/// Larger of |dx|, |dy| between an observation and the projection of its point; infinity when the
/// point is not in front of the camera.
double BoxResidual(const MinimaxProblem& problem,
                   const MinimaxStructure& structure,
                   const ImageObservation& observation);

/// Largest BoxResidual of all observations: the quantity the solver minimises. An upper bound of
/// the optimum, whatever the structure. Zero for no observations.
double MaxBoxResidual(const MinimaxProblem& problem, const MinimaxStructure& structure);

/// Throws std::invalid_argument when an index is out of range, a number is not finite or the flags
/// of what is fixed are not as many as views or points.
void CheckProblem(const MinimaxProblem& problem);

}  // namespace rotslam
