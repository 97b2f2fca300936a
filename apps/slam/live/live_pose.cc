#include "apps/slam/live/live_pose.h"

#include <algorithm>
#include <vector>

#include <Eigen/Dense>

#include "ba/cost/reprojection_cost.h"
#include "krot/initialisation/resection.h"

namespace rotslam {
namespace {

std::vector<PointObservation2D3D> SeenPointsOf(const LiveMap& map, const Features& features) {
  std::vector<PointObservation2D3D> seen;
  seen.reserve(features.size());
  for (int n = 0; n < features.size(); ++n) {
    const LivePoint* point = map.FindPoint(features.tracks[n]);
    if (point == nullptr) continue;
    seen.push_back({point->track, point->point_in_world, features.keypoints_px[n]});
  }
  return seen;
}

// How many points are seen within the error that an inlier may have.
int CountNear(const std::vector<PointObservation2D3D>& seen,
              const ResectionStart& start,
              const Camera& camera,
              double max_error_px) {
  return static_cast<int>(std::count_if(seen.begin(), seen.end(), [&](const auto& observation) {
    const auto keypoint =
        camera.Project(start.cam_from_world * (observation.point_in_world - start.center_in_world));
    return keypoint && (*keypoint - observation.keypoint_px).norm() <= max_error_px;
  }));
}

// The centre by the known rotation and a sample of the points, spread evenly.
std::optional<Eigen::Vector3d> CenterByRotation(const std::vector<PointObservation2D3D>& seen,
                                                const Rotation& cam_from_world,
                                                const Camera& camera,
                                                double max_error_px) {
  constexpr std::size_t kMaxPoints = 300;
  const std::size_t step = (seen.size() + kMaxPoints - 1) / kMaxPoints;
  const Rotation world_from_cam = cam_from_world.Inverse();
  std::vector<PosedRay> rays;
  rays.reserve(kMaxPoints);
  for (std::size_t k = 0; k < seen.size(); k += step) {
    const auto bearing = camera.Unproject(seen[k].keypoint_px);
    if (!bearing) continue;
    rays.push_back({Rotation(), seen[k].point_in_world, -(world_from_cam * *bearing)});
  }
  const auto found = ResectCenter(rays, {max_error_px / camera.MeanFocal(), 100, 1});
  if (!found) return std::nullopt;
  return found->center_in_world;
}

// With a rolling shutter, keypoints were moved to mid-frame by a rotation rate that was predicted.
// The points tell the rate better: moves the keypoints by what it was off.
// @param start  of the pose; about right.
void CorrectRate(const Camera& camera,
                 const ResectionStart& start,
                 std::vector<PointObservation2D3D>& seen) {
  constexpr int kIterations = 3;
  constexpr double kWidthPx = 3.0;    // of Geman-McClure's loss
  constexpr double kRateSigma = 0.5;  // of the prediction, rad/s
  using Vector9d = Eigen::Matrix<double, 9, 1>;
  using Matrix9d = Eigen::Matrix<double, 9, 9>;
  Rotation cam_from_world = start.cam_from_world;
  Eigen::Vector3d center = start.center_in_world;
  Eigen::Vector3d rate = Eigen::Vector3d::Zero();
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    Matrix9d H = Matrix9d::Zero();
    Vector9d g = Vector9d::Zero();
    const Eigen::Matrix3d R_c_w = cam_from_world.Matrix();
    for (const PointObservation2D3D& observation : seen) {
      ReprojectionJacobian J;
      const auto pixel = Reproject(camera, R_c_w, center, observation.point_in_world, &J);
      if (!pixel) continue;
      const double after_s = camera.ExposureTime(observation.keypoint_px);
      const Eigen::Vector2d residual =
          *pixel + after_s * (J.by_rotation * rate) - observation.keypoint_px;
      const double keep = kWidthPx * kWidthPx / (residual.squaredNorm() + kWidthPx * kWidthPx);
      Eigen::Matrix<double, 2, 9> J_all;
      J_all << J.by_rotation, J.by_center, after_s * J.by_rotation;
      H.noalias() += keep * keep * J_all.transpose() * J_all;
      g.noalias() += keep * keep * J_all.transpose() * residual;
    }
    H.bottomRightCorner<3, 3>().diagonal().array() += 1.0 / (kRateSigma * kRateSigma);
    g.tail<3>() += rate / (kRateSigma * kRateSigma);
    const Vector9d step = -H.ldlt().solve(g);
    if (!step.allFinite()) return;
    cam_from_world = Rotation::Exp(step.head<3>()) * cam_from_world;
    center += step.segment<3>(3);
    rate += step.tail<3>();
  }
  for (PointObservation2D3D& observation : seen) {
    ReprojectionJacobian J;
    if (!Reproject(camera, cam_from_world.Matrix(), center, observation.point_in_world, &J)) {
      continue;
    }
    observation.keypoint_px -=
        camera.ExposureTime(observation.keypoint_px) * (J.by_rotation * rate);
  }
}

}  // namespace

std::optional<ResectedPose> FindLivePose(const LiveMap& map,
                                         const Features& features,
                                         const ResectionStart& start,
                                         const Camera& camera,
                                         const ResectionOptions& options) {
  std::vector<PointObservation2D3D> seen = SeenPointsOf(map, features);
  if (std::ssize(seen) < options.min_inliers) return std::nullopt;
  // Wide enough for what the rotation is off.
  const double max_error_px = 2.0 * options.max_error_px;
  ResectionStart best = start;
  ResectionStart found = start;
  if (const auto center = CenterByRotation(seen, start.cam_from_world, camera, max_error_px)) {
    found.center_in_world = *center;
    if (CountNear(seen, found, camera, max_error_px) >=
        CountNear(seen, start, camera, max_error_px)) {
      best = found;
    }
  }
  if (camera.readout_s > 0.0) CorrectRate(camera, best, seen);
  // A start without a guess may need more steps.
  ResectionOptions patient = options;
  patient.max_iterations = 3 * options.max_iterations;
  return ResectFrame(camera, seen, best, patient);
}

}  // namespace rotslam
