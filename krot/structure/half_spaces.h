#pragma once

#include <vector>

#include <Eigen/Core>

#include "krot/structure/minimax_problem.h"
#include "krot/structure/structure_system.h"

namespace rotslam {

/// Five values per observation, one for each half-space: right, left, below, above, depth.
using Five = Eigen::Array<double, 5, 1>;
using Fives = std::vector<Five>;

/// The rows a_k . (X - c) of the linear programs (see minimax_lp.h) at one image bound, for methods
/// that do not form the matrix. StructureLayout defines the order of the unknowns.
class HalfSpaces {
 public:
  /// Keeps a reference to `problem`.
  HalfSpaces(const MinimaxProblem& problem, double gamma)
      : problem_(problem), layout_{problem.num_views(), problem.num_points}, gamma_(gamma) {
    axes_.reserve(problem.observations.size());
    for (const ImageObservation& observation : problem.observations) {
      const Eigen::Matrix3d& R_c_w = problem.R_c_w[observation.view];
      Eigen::Matrix3d axes;
      axes.col(0) = R_c_w.row(0) - observation.xy.x() * R_c_w.row(2);
      axes.col(1) = R_c_w.row(1) - observation.xy.y() * R_c_w.row(2);
      axes.col(2) = R_c_w.row(2);
      axes_.push_back(axes);
    }
  }

  int size() const { return static_cast<int>(axes_.size()); }
  const StructureLayout& layout() const { return layout_; }
  // Direction in which the depth of observation `o` grows, world axes.
  Eigen::Vector3d DepthAxis(int o) const { return axes_[o].col(2); }

  // a_k . (X - c)
  Five Apply(int o, const Eigen::VectorXd& x) const {
    const ImageObservation& observation = problem_.observations[o];
    Eigen::Vector3d d = x.segment<3>(layout_.Point(observation.point));
    if (observation.view > 0) d -= x.segment<3>(layout_.Center(observation.view));
    const Eigen::Vector3d m = axes_[o].transpose() * d;
    const double margin = gamma_ * m.z();
    return {m.x() - margin, -m.x() - margin, m.y() - margin, -m.y() - margin, -m.z()};
  }
  // sum y_k a_k
  Eigen::Vector3d Transposed(int o, const Five& y) const {
    return axes_[o] *
           Eigen::Vector3d(y[0] - y[1], y[2] - y[3], -gamma_ * (y[0] + y[1] + y[2] + y[3]) - y[4]);
  }
  // sum D_k a_k a_k^T
  Eigen::Matrix3d Normal(int o, const Five& D) const {
    const double x = D[0] + D[1];
    const double y = D[2] + D[3];
    const double xz = gamma_ * (D[1] - D[0]);
    const double yz = gamma_ * (D[3] - D[2]);
    const double z = gamma_ * gamma_ * (x + y) + D[4];
    Eigen::Matrix3d weight;
    weight << x, 0.0, xz, 0.0, y, yz, xz, yz, z;
    return axes_[o] * weight * axes_[o].transpose();
  }
  // Adds an observation's vector to its point and subtracts it from its centre.
  void Scatter(int o, const Eigen::Vector3d& v, Eigen::VectorXd& sum) const {
    const ImageObservation& observation = problem_.observations[o];
    sum.segment<3>(layout_.Point(observation.point)) += v;
    if (observation.view > 0) sum.segment<3>(layout_.Center(observation.view)) -= v;
  }

 private:
  const MinimaxProblem& problem_;
  StructureLayout layout_;
  double gamma_;
  std::vector<Eigen::Matrix3d> axes_;  // columns r1 - u r3, r2 - v r3, r3
};

/// Converts a structure to the vector of unknowns in the gauge of view 0, and back.
Eigen::VectorXd Packed(const StructureLayout& layout, const MinimaxStructure& structure);
MinimaxStructure Unpacked(const StructureLayout& layout, const Eigen::VectorXd& x);

}  // namespace rotslam
