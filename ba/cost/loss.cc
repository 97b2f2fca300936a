#include "ba/cost/loss.h"

#include <cmath>

namespace rotslam {

std::unique_ptr<ceres::LossFunction> MakeLoss(const BundleRound& round) {
  if (round.loss == RobustLoss::kHuber) return std::make_unique<ceres::HuberLoss>(round.loss_scale);
  if (round.loss == RobustLoss::kCauchy)
    return std::make_unique<ceres::CauchyLoss>(round.loss_scale);
  return nullptr;
}

RobustResidual UnderHuberLoss(const Eigen::Vector2d& residual, double bend) {
  RobustResidual robust = {residual, Eigen::Matrix2d::Identity()};
  const double length = residual.norm();
  if (bend == 0.0 || length <= bend) return robust;
  const double root = std::sqrt(bend * (2.0 * length - bend));
  const double across = std::sqrt(bend / length);
  const double along = bend / root;
  const Eigen::Vector2d direction = residual / length;
  robust.value = root * direction;
  robust.weight =
      across * Eigen::Matrix2d::Identity() + (along - across) * direction * direction.transpose();
  return robust;
}

}  // namespace rotslam
