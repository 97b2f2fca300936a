#pragma once

#include <ceres/cost_function.h>

#include "rotodom/types/rotation.h"

namespace rotslam {

/// Log(Exp(turn) * start * given^-1) / sigma: how far a frame's orientation is from the one that it
/// is expected to have, in standard deviations about the camera's axes. The parameter is the turn
/// of TurnedRotation, three numbers.
/// Error: derivatives equal central differences to 1e-7 of their size (ba tests).
class RotationPriorCost final : public ceres::CostFunction {
 public:
  /// @param start      where the turn is zero.
  /// @param given      expected; both cam_from_world.
  /// @param sigma_rad  per axis, positive.
  RotationPriorCost(const Rotation& start, const Rotation& given, double sigma_rad);
  bool Evaluate(double const* const* parameters,
                double* residuals,
                double** jacobians) const override;

 private:
  Rotation start_from_given_;
  double sigma_rad_;
};

}  // namespace rotslam
