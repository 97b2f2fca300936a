#pragma once

#include <map>

#include <Eigen/Core>

#include "rotodom/camera/camera.h"
#include "rotodom/types/ids.h"

namespace rotslam {

/// The focal length of each frame over that of the camera, where a lens zooms; frames that are
/// missing have the camera's.
using FocalScales = std::map<FrameId, double>;

/// That of a frame.
inline double ScaleOf(const FocalScales& scales, FrameId frame) {
  const auto found = scales.find(frame);
  return found == scales.end() ? 1.0 : found->second;
}

/// The camera with its focal length multiplied. Distortion stays what it is at the same angle.
inline Camera Zoomed(Camera camera, double scale) {
  camera.fx *= scale;
  camera.fy *= scale;
  return camera;
}

/// Where the zoomed camera shows what the camera shows at `keypoint_px`. With 1 / scale the way
/// back.
inline Eigen::Vector2d Zoomed(const Eigen::Vector2d& keypoint_px,
                              const Camera& camera,
                              double scale) {
  const Eigen::Vector2d principal_point(camera.cx, camera.cy);
  return principal_point + scale * (keypoint_px - principal_point);
}

}  // namespace rotslam
