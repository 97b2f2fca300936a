#include "apps/slam/map/path_growth.h"

#include <cmath>
#include <iterator>
#include <utility>

#include "rotodom/types/median.h"

namespace rotslam {
namespace {

// Fewer frames do not tell a deviation.
constexpr int kMinSamples = 5;

// Sum of squares over frames and axes.
struct SquaredError {
  double sum = 0.0;
  int count = 0;

  void Add(const Eigen::Vector3d& error) {
    sum += error.squaredNorm() / 3.0;
    ++count;
  }
  void AppendTo(double span, std::map<double, double>& table) const {
    if (count >= kMinSamples && sum > 0.0) table[span] = std::sqrt(sum / count);
  }
};

// The table at `span`, log-log; outside of it by the powers given.
double ValueAt(const std::map<double, double>& table,
               double span,
               double power_below,
               double power_above) {
  if (table.empty() || !(span > 0.0)) return 0.0;
  const auto above = table.lower_bound(span);
  if (above == table.end()) {
    return table.rbegin()->second * std::pow(span / table.rbegin()->first, power_above);
  }
  if (above == table.begin()) return above->second * std::pow(span / above->first, power_below);
  const auto below = std::prev(above);
  const double weight = std::log(span / below->first) / std::log(above->first / below->first);
  return below->second * std::pow(above->second / below->second, weight);
}

}  // namespace

PathGrowth::PathGrowth(const CenterMap& centers, const std::vector<double>& timestamps_s) {
  if (centers.size() < 2) return;
  std::vector<double> intervals_s;
  for (std::size_t k = 1; k < timestamps_s.size(); ++k) {
    intervals_s.push_back(timestamps_s[k] - timestamps_s[k - 1]);
  }
  interval_s_ = Median(std::move(intervals_s));
  const int length = centers.rbegin()->first.value - centers.begin()->first.value;
  for (int span = 1; span <= length; span *= 2) {
    SquaredError interpolation;
    SquaredError holding;
    for (const auto& [frame, center] : centers) {
      const auto before = centers.find(FrameId{frame.value - span});
      if (before == centers.end()) continue;
      holding.Add(center - before->second);
      const auto after = centers.find(FrameId{frame.value + span});
      if (after == centers.end()) continue;
      const double from_s = timestamps_s[before->first.value];
      const double to_s = timestamps_s[after->first.value];
      const double weight = (timestamps_s[frame.value] - from_s) / (to_s - from_s);
      interpolation.Add((1.0 - weight) * before->second + weight * after->second - center);
    }
    interpolation.AppendTo(span, interpolation_);
    holding.AppendTo(span, holding_);
  }
}

double PathGrowth::OfInterpolation(double before_s, double after_s) const {
  if (!(interval_s_ > 0.0)) return 0.0;
  return ValueAt(interpolation_, std::sqrt(before_s * after_s) / interval_s_, 2.0, 1.5);
}

double PathGrowth::OfHolding(double distance_s) const {
  if (!(interval_s_ > 0.0)) return 0.0;
  return ValueAt(holding_, distance_s / interval_s_, 1.0, 1.0);
}

}  // namespace rotslam
