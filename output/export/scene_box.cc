#include "output/export/scene_box.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

namespace rotslam {
namespace {

// Room between what must be in a box and its sides.
constexpr double kFilled = 0.95;
constexpr int kLargestBox = 128;
constexpr double kShareInside = 0.99;

// Half the side of a cube around `middle` that reaches as far as `position`.
double ReachTo(const Eigen::Vector3d& position, const Eigen::Vector3d& middle) {
  return (position - middle).cwiseAbs().maxCoeff();
}

// The middle of the cameras and of those points that are not the outermost along an axis.
Eigen::Vector3d MiddleOf(const std::vector<Eigen::Vector3d>& centers,
                         const std::vector<Eigen::Vector3d>& points) {
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3d& center : centers) box.extend(center);
  for (int axis = 0; axis < 3 && !points.empty(); ++axis) {
    std::vector<double> values;
    values.reserve(points.size());
    for (const Eigen::Vector3d& point : points) values.push_back(point[axis]);
    std::sort(values.begin(), values.end());
    const std::size_t margin = values.size() / 20;
    const double low = values[margin];
    const double high = values[values.size() - 1 - margin];
    box.min()[axis] = std::min(box.min()[axis], low);
    box.max()[axis] = std::max(box.max()[axis], high);
  }
  return box.center();
}

}  // namespace

SceneBox ChooseSceneBox(const std::vector<Eigen::Vector3d>& centers,
                        const std::vector<Eigen::Vector3d>& points) {
  SceneBox result;
  if (centers.empty() && points.empty()) return result;
  const Eigen::Vector3d middle = MiddleOf(centers, points);
  double reach_of_cameras = 0.0;
  for (const Eigen::Vector3d& center : centers) {
    reach_of_cameras = std::max(reach_of_cameras, ReachTo(center, middle));
  }
  std::vector<double> reach;
  reach.reserve(points.size());
  for (const Eigen::Vector3d& point : points) reach.push_back(ReachTo(point, middle));
  std::sort(reach.begin(), reach.end());
  const auto reach_of_share = [&](double share) {
    if (reach.empty()) return reach_of_cameras;
    const auto count =
        static_cast<std::size_t>(std::ceil(share * static_cast<double>(reach.size())));
    return std::max(reach_of_cameras, reach[std::max<std::size_t>(count, 1) - 1]);
  };
  const double inner = reach_of_share(0.5);
  if (inner > 0.0) result.scale = 0.5 * kFilled / inner;
  const auto box_for = [&](double outer) { return 2.0 * result.scale * outer / kFilled; };
  if (box_for(reach_of_share(1.0)) > kLargestBox) {
    const double too_large = box_for(reach_of_share(kShareInside)) / kLargestBox;
    result.scale /= std::max(1.0, too_large);
  }
  const double wanted = box_for(reach_of_share(1.0));
  while (result.aabb_scale < wanted * (1.0 - 1e-9) && result.aabb_scale < kLargestBox) {
    result.aabb_scale *= 2;
  }
  result.offset = Eigen::Vector3d::Constant(0.5) - result.scale * middle;
  const double half = 0.5 * result.aabb_scale / result.scale;
  result.num_outside = static_cast<int>(
      std::count_if(reach.begin(), reach.end(), [&](double value) { return value > half; }));
  return result;
}

}  // namespace rotslam
