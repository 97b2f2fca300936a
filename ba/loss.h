#pragma once

#include <memory>

#include <ceres/loss_function.h>

#include "ba/bundle_options.h"

namespace rotslam {

/// The round's robust loss, of residuals in sigmas; null where it has none.
std::unique_ptr<ceres::LossFunction> MakeLoss(const BundleRound& round);

}  // namespace rotslam
