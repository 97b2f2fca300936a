#include "rotodom/tracking/shutter.h"

#include "rotodom/types/rotation.h"

namespace rotslam {

std::optional<Eigen::Vector3d> BearingInMidFrame(const Eigen::Vector2d& keypoint_px,
                                                 const Camera& camera,
                                                 const Eigen::Vector3d& rate,
                                                 const Eigen::Vector2d& flow_px_per_s) {
  if (camera.readout_s == 0.0) return camera.Unproject(keypoint_px);
  const double late_s = camera.ExposureTime(keypoint_px);
  const auto bearing = camera.Unproject(keypoint_px - late_s * flow_px_per_s);
  if (!bearing) return std::nullopt;
  return Rotation::Exp(-late_s * rate) * *bearing;
}

void MoveToMidFrame(const Camera& camera, const Eigen::Vector3d& rate, Features& corners) {
  if (camera.readout_s == 0.0) return;
  for (int n = 0; n < corners.size(); ++n) {
    const auto bearing = BearingInMidFrame(corners.keypoints_px[n], camera, rate);
    if (!bearing) continue;
    corners.bearings[n] = *bearing;
    if (const auto moved = camera.Project(*bearing)) corners.keypoints_px[n] = *moved;
  }
}

}  // namespace rotslam
