#pragma once

#include <memory>

#include <Eigen/Core>
#include <ceres/loss_function.h>

#include "ba/types/bundle_options.h"

namespace rotslam {

/// The round's robust loss, of residuals in sigmas; null where it has none.
std::unique_ptr<ceres::LossFunction> MakeLoss(const BundleRound& round);

/// A residual as least squares takes it, when Huber's loss is to be minimised: as long as the root
/// of the loss. A residual's derivatives J become weight * J. The gradient is the loss' own; the
/// curvature is exact across the residual, and along it that of the root, between the loss' own,
/// none, and that of reweighted least squares (as Ceres has it for losses that flatten), which take
/// the same along as across. With a tenth of the observations past the bend those take a third more
/// steps. Not for losses that turn back: there the root's steps are far too long.
struct RobustResidual {
  Eigen::Vector2d value;
  Eigen::Matrix2d weight;
};

/// @param bend  length at which the loss leaves the quadratic; 0: never.
RobustResidual UnderHuberLoss(const Eigen::Vector2d& residual, double bend);

}  // namespace rotslam
