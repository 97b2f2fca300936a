#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace rotslam {

/// Standard deviation of a normal distribution over the median of the distances from its mean.
inline constexpr double kSigmasPerMedianDeviation = 1.4826;

/// The middle value, the upper of the two where the count is even; `if_none` of an empty list.
/// Cost: linear.
inline double Median(std::vector<double> values, double if_none = 0.0) {
  if (values.empty()) return if_none;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace rotslam
