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
/// coordinates. The centre of view 0 is the origin.
struct MinimaxProblem {
  std::vector<Eigen::Matrix3d> R_c_w;
  int num_points = 0;
  std::vector<ImageObservation> observations;
  // Views and points fixed at their start values; empty: none. View 0 is always fixed.
  std::vector<bool> view_fixed;
  std::vector<bool> point_fixed;

  bool ViewFixed(int view) const { return view == 0 || (!view_fixed.empty() && view_fixed[view]); }
  bool PointFixed(int point) const { return !point_fixed.empty() && point_fixed[point]; }
  int num_views() const { return static_cast<int>(R_c_w.size()); }
};

/// A solution of a MinimaxProblem.
struct MinimaxStructure {
  std::vector<Eigen::Vector3d> center_in_world;
  std::vector<Eigen::Vector3d> point_in_world;
};

/// The larger of |dx| and |dy| between an observation and the projection of its point, in
/// normalised image units; infinity when the point is not in front of the camera.
double BoxResidual(const MinimaxProblem& problem,
                   const MinimaxStructure& structure,
                   const ImageObservation& observation);

/// Largest BoxResidual of all observations, which the solver minimises. For any structure it is an
/// upper bound of the optimum. Zero without observations.
double MaxBoxResidual(const MinimaxProblem& problem, const MinimaxStructure& structure);

/// Throws std::invalid_argument when an index is out of range, a number is not finite or the number
/// of flags differs from that of views or points.
void CheckProblem(const MinimaxProblem& problem);

}  // namespace rotslam
