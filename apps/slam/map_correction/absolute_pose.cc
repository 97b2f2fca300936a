#include "apps/slam/map_correction/absolute_pose.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <opencv2/calib3d.hpp>

#include "rotodom/types/splitmix64.h"

namespace rotslam {
namespace {

constexpr int kMaxTriples = 1000;
// Probability of having drawn no triple of inliers at which sampling stops.
constexpr double kMissed = 1e-3;

using Triple = std::array<const PointObservation2D3D*, 3>;

// @param triple  keypoints that the camera model reaches.
std::vector<ResectionStart> PosesOf(const Camera& camera, const Triple& triple) {
  cv::Mat points(3, 1, CV_64FC3);
  cv::Mat images(3, 1, CV_64FC2);
  for (int k = 0; k < 3; ++k) {
    const Eigen::Vector3d& point = triple[k]->point_in_world;
    const Eigen::Vector3d bearing = *camera.Unproject(triple[k]->keypoint_px);
    points.at<cv::Vec3d>(k) = {point.x(), point.y(), point.z()};
    images.at<cv::Vec2d>(k) = {bearing.x() / bearing.z(), bearing.y() / bearing.z()};
  }
  std::vector<cv::Mat> turns;
  std::vector<cv::Mat> shifts;
  cv::solveP3P(points, images, cv::Matx33d::eye(), cv::noArray(), turns, shifts, cv::SOLVEPNP_AP3P);
  std::vector<ResectionStart> poses;
  for (std::size_t k = 0; k < turns.size(); ++k) {
    const Eigen::Vector3d turn(turns[k].ptr<double>());
    const Eigen::Vector3d shift(shifts[k].ptr<double>());
    if (!turn.allFinite() || !shift.allFinite()) continue;
    const Rotation cam_from_world = Rotation::Exp(turn);
    poses.push_back({cam_from_world, -(cam_from_world.Inverse() * shift), std::nullopt});
  }
  return poses;
}

}  // namespace

std::optional<ResectedPose> FindAbsolutePose(const Camera& camera,
                                             const std::vector<PointObservation2D3D>& observations,
                                             const ResectionOptions& options,
                                             std::uint64_t seed) {
  constexpr double kLeastDepth = 0.1;
  std::vector<const PointObservation2D3D*> seen;
  for (const PointObservation2D3D& observation : observations) {
    const auto bearing = camera.Unproject(observation.keypoint_px);
    if (!bearing || bearing->z() < kLeastDepth * bearing->norm()) continue;
    seen.push_back(&observation);
  }
  const int count = static_cast<int>(seen.size());
  if (count < std::max(3, options.min_inliers)) return std::nullopt;
  const auto count_inliers = [&](const ResectionStart& pose) {
    const Eigen::Matrix3d R_c_w = pose.cam_from_world.Matrix();
    int num_inliers = 0;
    for (const PointObservation2D3D& observation : observations) {
      const auto pixel = camera.Project(
          Eigen::Vector3d(R_c_w * (observation.point_in_world - pose.center_in_world)));
      if (pixel && (*pixel - observation.keypoint_px).norm() <= options.max_error_px) ++num_inliers;
    }
    return num_inliers;
  };
  SplitMix64 random(seed);
  std::optional<ResectionStart> best;
  int most_inliers = 0;
  int num_wanted = kMaxTriples;
  for (int k = 0; k < num_wanted; ++k) {
    const std::array<int, 3> drawn = {
        random.Index(count), random.Index(count), random.Index(count)};
    if (drawn[0] == drawn[1] || drawn[1] == drawn[2] || drawn[2] == drawn[0]) continue;
    for (ResectionStart& pose : PosesOf(camera, {seen[drawn[0]], seen[drawn[1]], seen[drawn[2]]})) {
      const int num_inliers = count_inliers(pose);
      if (num_inliers <= most_inliers) continue;
      most_inliers = num_inliers;
      best = std::move(pose);
      const double share = static_cast<double>(num_inliers) / count;
      const double tries = std::log(kMissed) / std::log1p(-std::min(0.999, share * share * share));
      num_wanted = std::min(kMaxTriples, static_cast<int>(std::ceil(tries)));
    }
  }
  if (!best) return std::nullopt;
  return ResectFrame(camera, observations, *best, options);
}

}  // namespace rotslam
