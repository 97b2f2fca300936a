#include "ba/zoom/focal_resection.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "ba/zoom/zoomed_projection.h"
#include "rotodom/types/median.h"

namespace rotslam {
namespace {

constexpr int kLeastInliers = 20;
constexpr int kMaxResectionSteps = 40;
constexpr double kMaxStep = 0.3;     // rad, and of the logarithm of the focal length
constexpr double kSmallStep = 1e-7;  // far below what the points tell
constexpr double kLeastNoise_px = 0.02;
constexpr double kMaxLogSigma = 0.05;
// What Geman-McClure's weight falls off at, and what is an inlier, in deviations.
constexpr double kInlierScale = 3.0;

using FocalNormal = Eigen::Matrix<double, 7, 7>;  // rotation, centre, logarithm of the scale
using FocalUpdate = Eigen::Matrix<double, 7, 1>;

// The deviation along an axis of which the median distance in the plane is this.
double MedianNoise(std::vector<double> distances) {
  return std::max(Median(std::move(distances)) / 1.18, kLeastNoise_px);
}

std::vector<double> PixelDistances(const Camera& camera,
                                   const std::vector<PointObservation2D3D>& observations,
                                   const ZoomedPose& pose) {
  constexpr double kUnseen_px = 1e3;
  std::vector<double> distances;
  distances.reserve(observations.size());
  for (const PointObservation2D3D& seen : observations) {
    const auto pixel = ProjectZoomed(camera, pose, seen.point_in_world);
    distances.push_back(pixel ? (*pixel - seen.keypoint_px).norm() : kUnseen_px);
  }
  return distances;
}

}  // namespace

std::optional<FocalResection> ResectWithFocal(const Camera& camera,
                                              const std::vector<PointObservation2D3D>& observations,
                                              const ZoomedPose& start,
                                              bool moves) {
  FocalResection result;
  ZoomedPose& pose = result.pose;
  pose = start;
  FocalNormal normal;
  for (int iteration = 0; iteration < kMaxResectionSteps; ++iteration) {
    const std::vector<double> distances = PixelDistances(camera, observations, pose);
    const double noise_px = MedianNoise(distances);
    normal.setZero();
    FocalUpdate right = FocalUpdate::Zero();
    for (std::size_t n = 0; n < observations.size(); ++n) {
      ZoomedJacobian J;
      const auto pixel = ProjectZoomed(camera, pose, observations[n].point_in_world, &J);
      if (!pixel) continue;
      const double square = std::pow(distances[n] / (kInlierScale * noise_px), 2);
      const double weight = 1.0 / ((1.0 + square) * (1.0 + square));
      Eigen::Matrix<double, 2, 7> jacobian;
      jacobian << J.by_turn, -J.by_point, J.by_log_scale;
      normal += weight * jacobian.transpose() * jacobian;
      right += weight * jacobian.transpose() * (observations[n].keypoint_px - *pixel);
    }
    if (!moves) {
      normal.middleRows<3>(3).setZero();
      normal.middleCols<3>(3).setZero();
      normal.block<3, 3>(3, 3).setIdentity();
      right.segment<3>(3).setZero();
    }
    FocalUpdate update = normal.ldlt().solve(right);
    if (!update.allFinite()) return std::nullopt;
    const double size = std::max(update.head<3>().norm(), std::abs(update[6]));
    if (size > kMaxStep) update *= kMaxStep / size;
    pose.cam_from_world = Rotation::Exp(update.head<3>()) * pose.cam_from_world;
    pose.center_in_world += update.segment<3>(3);
    pose.log_scale += update[6];
    if (size < kSmallStep) break;
  }
  const std::vector<double> distances = PixelDistances(camera, observations, pose);
  result.noise_px = MedianNoise(distances);
  result.num_inliers =
      static_cast<int>(std::count_if(distances.begin(), distances.end(), [&](double distance_px) {
        return distance_px < kInlierScale * result.noise_px;
      }));
  const double variance = normal.ldlt().solve(FocalUpdate::Unit(6))[6];
  result.log_scale_sigma = result.noise_px * std::sqrt(std::max(variance, 0.0));
  if (result.num_inliers < kLeastInliers || !(result.log_scale_sigma < kMaxLogSigma)) {
    return std::nullopt;
  }
  return result;
}

}  // namespace rotslam
