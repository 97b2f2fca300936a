#include "rotodom/sensor_orientations/random_walk.h"

#include <utility>

namespace rotslam {

RandomWalkSmoother::RandomWalkSmoother(std::vector<double> weights,
                                       std::span<const double> step_variances)
    : weights_(std::move(weights)) {
  links_.reserve(step_variances.size());
  for (const double variance : step_variances) links_.push_back(1.0 / variance);
  // Eliminating a value leaves what it passes on to the next one: both in series. This form has no
  // differences, so nothing cancels where links are far stronger than weights.
  gathered_.reserve(weights_.size());
  for (std::size_t k = 0; k < weights_.size(); ++k) {
    double passed_on = 0.0;
    if (k > 0) passed_on = gathered_[k - 1] * links_[k - 1] / (gathered_[k - 1] + links_[k - 1]);
    gathered_.push_back(weights_[k] + passed_on);
  }
}

Eigen::MatrixXd RandomWalkSmoother::Smooth(const Eigen::MatrixXd& observations) const {
  Eigen::MatrixXd x = observations;
  const auto size = static_cast<Eigen::Index>(weights_.size());
  for (Eigen::Index k = 0; k < size; ++k) {
    x.row(k) *= weights_[k];
    if (k > 0) x.row(k) += links_[k - 1] / (gathered_[k - 1] + links_[k - 1]) * x.row(k - 1);
  }
  for (Eigen::Index k = size - 1; k >= 0; --k) {
    const double link = k + 1 < size ? links_[k] : 0.0;
    if (k + 1 < size) x.row(k) += link * x.row(k + 1);
    x.row(k) /= gathered_[k] + link;
  }
  return x;
}

std::vector<double> RandomWalkSmoother::Variances() const {
  std::vector<double> variances(weights_.size());
  double from_behind = 0.0;
  for (std::size_t k = weights_.size(); k-- > 0;) {
    variances[k] = 1.0 / (gathered_[k] + from_behind);
    if (k > 0) {
      const double gathered = weights_[k] + from_behind;
      from_behind = gathered * links_[k - 1] / (gathered + links_[k - 1]);
    }
  }
  return variances;
}

}  // namespace rotslam
