#include "apps/slam/map/cloud_outliers.h"

#include <iterator>
#include <memory>
#include <stdexcept>
#include <vector>

#include <pcl/filters/statistical_outlier_removal.h>
#include <pcl/point_cloud.h>
#include <pcl/point_types.h>

#include "rotodom/types/options.h"

namespace rotslam {
namespace {

// Neighbours whose mean distance says how alone a point is. Fewer follow the surface more closely
// and take small groups of wrong points for surface.
constexpr int kNumNeighbours = 16;

}  // namespace

std::optional<std::string> CloudOutlierOptions::Problem() const {
  if (!(max_sigmas > 0.0)) return OutOfRange("max_sigmas", max_sigmas, "above zero");
  return std::nullopt;
}

PointMap WithoutOutliers(const PointMap& points, const CloudOutlierOptions& options) {
  if (const auto problem = options.Problem()) {
    throw std::invalid_argument("WithoutOutliers: " + *problem);
  }
  if (!options.remove || std::ssize(points) <= kNumNeighbours) return points;
  const auto cloud = std::make_shared<pcl::PointCloud<pcl::PointXYZ>>();
  cloud->reserve(points.size());
  for (const auto& [track, point] : points) {
    const Eigen::Vector3f position = point.cast<float>();
    cloud->push_back({position.x(), position.y(), position.z()});
  }
  pcl::StatisticalOutlierRemoval<pcl::PointXYZ> filter;
  filter.setInputCloud(cloud);
  filter.setMeanK(kNumNeighbours);
  filter.setStddevMulThresh(options.max_sigmas);
  pcl::Indices kept;
  filter.filter(kept);
  std::vector<bool> is_kept(points.size(), false);
  for (const pcl::index_t index : kept) is_kept[static_cast<std::size_t>(index)] = true;
  PointMap rest;
  std::size_t k = 0;
  for (const auto& entry : points) {
    if (is_kept[k++]) rest.insert(entry);
  }
  return rest;
}

}  // namespace rotslam
