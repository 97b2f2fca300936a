#include "ba/cost/lens_prior.h"

namespace rotslam {

bool LensPriorCost::Evaluate(double const* const* parameters,
                             double* residuals,
                             double** jacobians) const {
  const Eigen::Map<const LensBlock> lens(parameters[0]);
  Eigen::Map<LensBlock> residual(residuals);
  residual = (lens - expected_).cwiseQuotient(sigmas_);
  if (jacobians != nullptr && jacobians[0] != nullptr) {
    Eigen::Map<Eigen::Matrix<double, kLensBlockSize, kLensBlockSize, Eigen::RowMajor>> J(
        jacobians[0]);
    J = sigmas_.cwiseInverse().asDiagonal();
  }
  return true;
}

}  // namespace rotslam
