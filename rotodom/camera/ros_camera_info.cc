#include "rotodom/camera/ros_camera_info.h"

#include <algorithm>
#include <stdexcept>

namespace rotslam {

Camera CameraOf(const RosCameraInfo& info, bool is_rectified) {
  Camera camera;
  camera.width = info.width;
  camera.height = info.height;
  camera.fx = is_rectified ? info.P[0] : info.K[0];
  camera.fy = is_rectified ? info.P[5] : info.K[4];
  camera.cx = is_rectified ? info.P[2] : info.K[2];
  camera.cy = is_rectified ? info.P[6] : info.K[5];
  if (camera.fx == 0.0) throw std::runtime_error("K is all zeros: the camera is not calibrated");
  const bool is_zero = std::all_of(info.D.begin(), info.D.end(), [](double d) { return d == 0.0; });
  if (is_rectified || is_zero) return camera;
  std::size_t count = 5;
  camera.model = CameraModel::kRadtan;
  if (info.distortion_model == "rational_polynomial") {
    camera.model = CameraModel::kRational;
    count = 8;
  } else if (info.distortion_model == "equidistant" || info.distortion_model == "fisheye") {
    camera.model = CameraModel::kEquidistant;
    count = 4;
  } else if (info.distortion_model != "plumb_bob") {
    throw std::runtime_error("distortion_model is '" + info.distortion_model + "', must be other");
  }
  if (info.D.size() > count) throw std::runtime_error("D has too many numbers");
  std::copy(info.D.begin(), info.D.end(), camera.distortion.begin());
  return camera;
}

}  // namespace rotslam
