#pragma once

#include <array>

#include <Eigen/Core>

namespace rotslam {

/// Mean image motion by region, as a prediction for points that have no motion of their own yet.
class FlowField {
 public:
  FlowField(int image_width, int image_height) : width_(image_width), height_(image_height) {}

  void Add(const Eigen::Vector2d& keypoint_px, const Eigen::Vector2d& flow_px_per_s);
  /// Mean of the region around `keypoint_px`; of all regions where it has none, zero without any.
  Eigen::Vector2d At(const Eigen::Vector2d& keypoint_px) const;

 private:
  static constexpr int kColumns = 12;
  static constexpr int kRows = 8;
  int RegionOf(const Eigen::Vector2d& keypoint_px) const;

  struct Sum {
    Eigen::Vector2d flow = Eigen::Vector2d::Zero();
    int count = 0;
  };
  int width_;
  int height_;
  std::array<Sum, static_cast<std::size_t>(kColumns) * kRows> regions_;
  Sum total_;
};

}  // namespace rotslam
