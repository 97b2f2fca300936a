#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "apps/report/figures/drawing.h"

namespace rotslam {

/// A rectangle of a drawing that shows a range of data.
class Axes {
 public:
  struct Box {
    double left = 0.0;
    double top = 0.0;
    double width = 0.0;
    double height = 0.0;
  };

  explicit Axes(const Box& box) : box_(box) {}

  /// Widens the range of data to hold this point; NaN leaves a coordinate out.
  void Include(const Eigen::Vector2d& point);
  /// Fixes the range with a margin around the data; with `equal_scale` a unit has the same length
  /// in both directions.
  void Settle(bool equal_scale);

  /// Draws grid, frame, numbers and labels. Without `x_label` the numbers below are left out, too.
  void DrawFrame(const std::string& x_label, const std::string& y_label, Drawing& drawing) const;
  Eigen::Vector2d OnPage(const Eigen::Vector2d& point) const;
  /// Draws the parts of a line through data points that are within the axes.
  void DrawLine(const std::vector<Eigen::Vector2d>& points,
                const Stroke& stroke,
                Drawing& drawing) const;
  bool Contains(const Eigen::Vector2d& point) const;

 private:
  Box box_;
  Eigen::Vector2d low_ = Eigen::Vector2d::Constant(1e300);
  Eigen::Vector2d high_ = Eigen::Vector2d::Constant(-1e300);
};

}  // namespace rotslam
