#include "rotodom/sensor_orientations/orientation_series.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <Eigen/Cholesky>

namespace rotslam {
namespace {

// Clocks that are written with four digits agree to this, s.
constexpr double kSameTimeS = 1e-4;
// Steps whose lengths differ by more than this factor are not interpolated over by a cubic.
constexpr double kUneven = 3.0;

bool AreEven(double step, double other) { return step < kUneven * other && other < kUneven * step; }

}  // namespace

OrientationSeries::OrientationSeries(std::vector<double> timestamps_s,
                                     std::vector<Rotation> body_from_world,
                                     std::vector<bool> is_connected)
    : timestamps_s_(std::move(timestamps_s)),
      body_from_world_(std::move(body_from_world)),
      is_connected_(std::move(is_connected)) {}

std::optional<Rotation> OrientationSeries::At(double timestamp_s) const {
  const std::vector<double>& t = timestamps_s_;
  const std::size_t after =
      std::lower_bound(t.begin(), t.end(), timestamp_s - kSameTimeS) - t.begin();
  if (after == t.size()) return std::nullopt;
  if (t[after] <= timestamp_s + kSameTimeS) return body_from_world_[after];
  if (after == 0 || !is_connected_[after - 1]) return std::nullopt;
  const std::size_t k = after - 1;
  const double step = t[after] - t[k];
  const auto turn_to = [&](std::size_t other) {
    return (body_from_world_[other] * body_from_world_[k].Inverse()).Log();
  };
  const bool is_cubic = k > 0 && is_connected_[k - 1] && AreEven(t[k] - t[k - 1], step) &&
                        after + 1 < t.size() && is_connected_[after] &&
                        AreEven(t[after + 1] - t[after], step);
  const std::size_t first = is_cubic ? k - 1 : k;
  const std::size_t last = is_cubic ? after + 1 : after;
  Eigen::Vector3d turn = Eigen::Vector3d::Zero();
  for (std::size_t a = first; a <= last; ++a) {
    double weight = 1.0;  // Lagrange
    for (std::size_t b = first; b <= last; ++b) {
      if (b != a) weight *= (timestamp_s - t[b]) / (t[a] - t[b]);
    }
    if (a != k) turn += weight * turn_to(a);
  }
  return Rotation::Exp(turn) * body_from_world_[k];
}

std::optional<Rotation> OrientationSeries::AverageAt(double timestamp_s,
                                                     double half_window_s) const {
  constexpr std::size_t kLeast = 3;
  constexpr std::size_t kLeastOfParabola = 6;
  const std::vector<double>& t = timestamps_s_;
  const std::size_t first =
      std::lower_bound(t.begin(), t.end(), timestamp_s - half_window_s) - t.begin();
  std::size_t end = first;
  while (end < t.size() && t[end] <= timestamp_s + half_window_s &&
         (end == first || is_connected_[end - 1])) {
    ++end;
  }
  const std::size_t number = end - first;
  if (number < kLeast || t[first] > timestamp_s || t[end - 1] < timestamp_s) {
    return At(timestamp_s);
  }
  const Rotation& middle = body_from_world_[first + number / 2];
  const Eigen::Index num_terms = number < kLeastOfParabola ? 2 : 3;
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d moments = Eigen::Matrix3d::Zero();  // a column an axis
  for (std::size_t k = first; k < end; ++k) {
    const double x = (t[k] - timestamp_s) / half_window_s;
    const Eigen::Vector3d powers(1.0, x, x * x);
    normal += powers * powers.transpose();
    moments += powers * (body_from_world_[k] * middle.Inverse()).Log().transpose();
  }
  const Eigen::MatrixXd fitted =
      normal.topLeftCorner(num_terms, num_terms).ldlt().solve(moments.topRows(num_terms));
  return Rotation::Exp(fitted.row(0).transpose()) * middle;
}

Eigen::Vector3d OrientationSeries::RateAt(double timestamp_s) const {
  const std::vector<double>& t = timestamps_s_;
  if (t.size() < 2) return Eigen::Vector3d::Zero();
  const std::size_t after = std::upper_bound(t.begin(), t.end(), timestamp_s) - t.begin();
  // The sample nearest in time, and the ends of the steps beside it.
  std::size_t near = std::min(after, t.size() - 1);
  if (near > 0 && timestamp_s - t[near - 1] < std::abs(t[near] - timestamp_s)) --near;
  const std::size_t from = near > 0 && is_connected_[near - 1] ? near - 1 : near;
  const std::size_t to = near + 1 < t.size() && is_connected_[near] ? near + 1 : near;
  if (from == to) return Eigen::Vector3d::Zero();
  return (body_from_world_[to] * body_from_world_[from].Inverse()).Log() / (t[to] - t[from]);
}

}  // namespace rotslam
