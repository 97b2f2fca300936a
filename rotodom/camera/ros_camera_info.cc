#include "rotodom/camera/ros_camera_info.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "rotodom/camera/distortion.h"
#include "rotodom/camera/section.h"

namespace rotslam {
namespace {

void Require(const char* field, const std::optional<std::string>& problem) {
  if (problem) throw std::runtime_error(std::string(field) + " " + *problem);
}

void SetRosDistortion(const RosCameraInfo& info, Camera& camera) {
  const std::string model = Lower(info.distortion_model);
  const bool is_zero =
      std::all_of(info.D.begin(), info.D.end(), [](double value) { return value == 0.0; });
  if (model == "plumb_bob" || model == "rational_polynomial" || model == "radtan") {
    Require("D", SetOpenCvDistortion(info.D, camera));
  } else if (model == "equidistant" || model == "fisheye" || model == "kannala_brandt") {
    Require("D", SetFisheyeDistortion(info.D, camera));
  } else if (model == "fov") {
    Require("D", SetFovDistortion(info.D, camera));
  } else if ((model.empty() || model == "none") && is_zero) {
    camera.model = CameraModel::kPinhole;
  } else {
    throw std::runtime_error("distortion_model is '" + info.distortion_model +
                             "', must be plumb_bob, rational_polynomial, equidistant or fisheye");
  }
}

void SetProjection(const RosCameraInfo& info, Camera& camera) {
  const auto& P = info.P;
  const std::array<double, 9> K = {P[0], P[1], P[2], P[4], P[5], P[6], P[8], P[9], P[10]};
  Require("P", SetMatrix(K, camera));
  camera.model = CameraModel::kPinhole;
}

// Region of interest and binning along one axis.
struct Region {
  int offset = 0;
  int size = 0;  // 0: the whole axis
  int binning = 1;
};

// The axis' focal length, principal point and size after region of interest and binning.
void SetRegion(const Region& region, double& focal, double& centre, int& size) {
  if (region.size > 0) {
    centre -= region.offset;
    size = region.size;
  }
  if (region.binning <= 1) return;
  focal /= region.binning;
  centre = (centre + 0.5) / region.binning - 0.5;
  size /= region.binning;
}

}  // namespace

Camera CameraOf(const RosCameraInfo& info, bool is_rectified) {
  Camera camera;
  if (is_rectified) {
    SetProjection(info, camera);
  } else {
    const bool is_empty =
        std::all_of(info.K.begin(), info.K.end(), [](double value) { return value == 0.0; });
    if (is_empty) {
      throw std::runtime_error("K is all zeros: the camera is not calibrated");
    }
    Require("K", SetMatrix(info.K, camera));
    SetRosDistortion(info, camera);
  }
  if (std::min({info.width, info.height, info.binning_x, info.binning_y}) < 0 ||
      std::min({info.roi_x, info.roi_y, info.roi_width, info.roi_height}) < 0) {
    throw std::runtime_error("width, height, binning and roi must not be negative");
  }
  if ((info.roi_width == 0) != (info.roi_height == 0)) {
    throw std::runtime_error("roi has a width or a height of 0; must have both or none");
  }
  if ((info.width == 0) != (info.height == 0)) {
    throw std::runtime_error("width or height is 0; must give both or none");
  }
  camera.width = info.width;
  camera.height = info.height;
  SetRegion({info.roi_x, info.roi_width, info.binning_x}, camera.fx, camera.cx, camera.width);
  SetRegion({info.roi_y, info.roi_height, info.binning_y}, camera.fy, camera.cy, camera.height);
  return camera;
}

}  // namespace rotslam
