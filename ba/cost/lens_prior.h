#pragma once

#include <Eigen/Core>
#include <ceres/sized_cost_function.h>

#include "rotodom/camera/lens_parameters.h"

namespace rotslam {

/// One of the two blocks of LensParameters that bundle adjustment moves.
using LensBlock = Eigen::Matrix<double, kLensBlockSize, 1>;

/// (lens - expected) / sigma: the prior knowledge of the lens.
class LensPriorCost final : public ceres::SizedCostFunction<kLensBlockSize, kLensBlockSize> {
 public:
  /// @param sigmas  positive.
  LensPriorCost(const LensBlock& expected, const LensBlock& sigmas)
      : expected_(expected), sigmas_(sigmas) {}
  bool Evaluate(double const* const* parameters,
                double* residuals,
                double** jacobians) const override;

 private:
  LensBlock expected_;
  LensBlock sigmas_;
};

}  // namespace rotslam
