#pragma once

#include <array>
#include <string>
#include <vector>

#include "rotodom/camera/camera.h"

namespace rotslam {

/// A message sensor_msgs/CameraInfo, its fields under their names there.
struct RosCameraInfo {
  int width = 0;  // of the whole sensor, before binning and region of interest
  int height = 0;
  std::string distortion_model;
  std::vector<double> D;
  std::array<double, 9> K = {};
  std::array<double, 12> P = {};
  int binning_x = 0;  // 0 and 1: none
  int binning_y = 0;
  int roi_x = 0;
  int roi_y = 0;
  int roi_width = 0;  // 0 by 0: the whole image
  int roi_height = 0;
};

/// The camera of the images that come with the message: K and D, or P where the images are
/// rectified. Region of interest and binning change size, focal length and principal point; pixel
/// centres stay at integer coordinates.
/// Throws std::runtime_error, without a path, in one line that names the field: not calibrated
/// (K is zero), distortion model not supported, wrong number of coefficients.
Camera CameraOf(const RosCameraInfo& info, bool is_rectified);

}  // namespace rotslam
