#include "ba/cost/rotation_prior.h"

#include <Eigen/LU>

#include "ba/cost/reprojection_cost.h"

namespace rotslam {

RotationPriorCost::RotationPriorCost(const Rotation& start, const Rotation& given, double sigma_rad)
    : start_from_given_(start * given.Inverse()), sigma_rad_(sigma_rad) {
  set_num_residuals(3);
  mutable_parameter_block_sizes()->push_back(3);
}

bool RotationPriorCost::Evaluate(double const* const* parameters,
                                 double* residuals,
                                 double** jacobians) const {
  const Eigen::Vector3d turn = Eigen::Vector3d::Map(parameters[0]);
  const Eigen::Vector3d error = (Rotation::Exp(turn) * start_from_given_).Log();
  Eigen::Vector3d::Map(residuals) = error / sigma_rad_;
  if (jacobians == nullptr || jacobians[0] == nullptr) return true;
  // A change of the turn is one of LeftJacobian(turn) on the left, and so is one of the error.
  Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(jacobians[0]).noalias() =
      LeftJacobian(error).inverse() * LeftJacobian(turn) / sigma_rad_;
  return true;
}

}  // namespace rotslam
