#include "rotodom/tracking/flow_field.h"

#include <algorithm>

namespace rotslam {

int FlowField::RegionOf(const Eigen::Vector2d& keypoint_px) const {
  const int column = static_cast<int>(keypoint_px.x() * kColumns / width_);
  const int row = static_cast<int>(keypoint_px.y() * kRows / height_);
  return std::clamp(row, 0, kRows - 1) * kColumns + std::clamp(column, 0, kColumns - 1);
}

void FlowField::Add(const Eigen::Vector2d& keypoint_px, const Eigen::Vector2d& flow_px_per_s) {
  for (Sum* sum : {&regions_[RegionOf(keypoint_px)], &total_}) {
    sum->flow += flow_px_per_s;
    ++sum->count;
  }
}

Eigen::Vector2d FlowField::At(const Eigen::Vector2d& keypoint_px) const {
  for (const Sum* sum : {&regions_[RegionOf(keypoint_px)], &total_}) {
    if (sum->count > 0) return sum->flow / sum->count;
  }
  return Eigen::Vector2d::Zero();
}

}  // namespace rotslam
