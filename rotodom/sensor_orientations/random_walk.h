#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

namespace rotslam {

/// Least squares for values along a random walk that are observed with white noise: minimises
/// sum w_k |x_k - y_k|^2 + sum |x_k+1 - x_k|^2 / q_k.
class RandomWalkSmoother {
 public:
  /// @param weights         w, inverse variances of the n observations; zero where there is none,
  ///                        positive at least once.
  /// @param step_variances  q, n - 1, positive and finite.
  RandomWalkSmoother(std::vector<double> weights, std::span<const double> step_variances);

  /// The smoothed values x, of n x m observations y.
  Eigen::MatrixXd Smooth(const Eigen::MatrixXd& observations) const;

  /// Variances of the smoothed values, n.
  std::vector<double> Variances() const;

 private:
  std::vector<double> weights_;
  std::vector<double> links_;     // 1 / q
  std::vector<double> gathered_;  // weights of the values up to each, as they arrive at it
};

}  // namespace rotslam
