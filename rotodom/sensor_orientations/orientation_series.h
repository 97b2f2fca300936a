#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "rotodom/types/rotation.h"

namespace rotslam {

/// Orientations at ascending times, to be had at any time between.
class OrientationSeries {
 public:
  /// @param body_from_world  n, as many as timestamps.
  /// @param is_connected     n - 1: whether there may be interpolated between one and the next.
  OrientationSeries(std::vector<double> timestamps_s,
                    std::vector<Rotation> body_from_world,
                    std::vector<bool> is_connected);

  /// The orientation at a time: cubic in the rotation vectors of the four around it, where they are
  /// about evenly spaced, else linear. Within 0.1 ms of one of them that one. nullopt where the
  /// times do not reach or are not connected.
  std::optional<Rotation> At(double timestamp_s) const;

  /// The same from all orientations within `half_window_s` of the time, where they are three or
  /// more and reach to both sides of it: the least-squares line through their rotation vectors,
  /// from six on the parabola. Their noise averages out.
  std::optional<Rotation> AverageAt(double timestamp_s, double half_window_s) const;

  /// The rotation rate about the body's axes, rad/s: over the steps before and after, or the one of
  /// them that is connected. Zero where none is.
  Eigen::Vector3d RateAt(double timestamp_s) const;

  const std::vector<double>& timestamps_s() const { return timestamps_s_; }
  const Rotation& operator[](std::size_t k) const { return body_from_world_[k]; }

 private:
  std::vector<double> timestamps_s_;
  std::vector<Rotation> body_from_world_;
  std::vector<bool> is_connected_;
};

}  // namespace rotslam
