#include "krot/structure/minimax_problem.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "krot/lp/lp.h"

namespace rotslam {

double BoxResidual(const MinimaxProblem& problem,
                   const MinimaxStructure& structure,
                   const ImageObservation& observation) {
  const Eigen::Vector3d point_in_cam =
      problem.R_c_w[observation.view] *
      (structure.point_in_world[observation.point] - structure.center_in_world[observation.view]);
  if (!(point_in_cam.z() > 0.0)) return kInfinity;
  const double residual =
      (point_in_cam.head<2>() / point_in_cam.z() - observation.xy).cwiseAbs().maxCoeff();
  return std::isfinite(residual) ? residual : kInfinity;
}

double MaxBoxResidual(const MinimaxProblem& problem, const MinimaxStructure& structure) {
  double largest = 0.0;
  for (const ImageObservation& observation : problem.observations) {
    largest = std::max(largest, BoxResidual(problem, structure, observation));
  }
  return largest;
}

void CheckProblem(const MinimaxProblem& problem) {
  for (const Eigen::Matrix3d& R_c_w : problem.R_c_w) {
    if (!R_c_w.allFinite()) throw std::invalid_argument("minimax problem: rotation not finite");
  }
  const auto fits = [](const std::vector<bool>& flags, int count) {
    return flags.empty() || std::ssize(flags) == count;
  };
  if (!fits(problem.view_fixed, problem.num_views()) ||
      !fits(problem.point_fixed, problem.num_points)) {
    throw std::invalid_argument("minimax problem: one flag per view and per point expected");
  }
  for (const ImageObservation& observation : problem.observations) {
    if (observation.view < 0 || observation.view >= problem.num_views() || observation.point < 0 ||
        observation.point >= problem.num_points) {
      throw std::invalid_argument("minimax problem: observation names an unknown view or point");
    }
    if (!observation.xy.allFinite()) {
      throw std::invalid_argument("minimax problem: observation not finite");
    }
  }
}

}  // namespace rotslam
