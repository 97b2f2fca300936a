#include "rotodom/relative_rotation/information_criterion.h"

#include <algorithm>
#include <cmath>

namespace rotslam {
namespace {

// @param codimension  number of constraints per match; residuals are truncated at two variances for
//                     each.
double Criterion(const std::vector<double>& squares,
                 double per_variance,
                 int codimension,
                 int num_parameters) {
  constexpr int kDimensions = 4;
  const double n = static_cast<double>(squares.size());
  double sum = (kDimensions - codimension) * n * std::log(4.0) + num_parameters * std::log(4.0 * n);
  for (const double squared : squares) sum += std::min(squared * per_variance, 2.0 * codimension);
  return sum;
}

}  // namespace

double EpipolarCriterion(const std::vector<double>& squared_distances, double noise) {
  return Criterion(squared_distances, 1.0 / (noise * noise), 1, 5);
}

double RotationCriterion(const std::vector<double>& squared_flows, double noise) {
  // Both images' noise enters the difference of the bearings, so its variance per axis is twice the
  // noise's.
  return Criterion(squared_flows, 0.5 / (noise * noise), 2, 3);
}

}  // namespace rotslam
