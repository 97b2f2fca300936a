#include "ba/loss.h"

namespace rotslam {

std::unique_ptr<ceres::LossFunction> MakeLoss(const BundleRound& round) {
  if (round.loss == "huber") return std::make_unique<ceres::HuberLoss>(round.loss_scale);
  if (round.loss == "cauchy") return std::make_unique<ceres::CauchyLoss>(round.loss_scale);
  return nullptr;
}

}  // namespace rotslam
