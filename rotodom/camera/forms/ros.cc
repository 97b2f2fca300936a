#include <algorithm>
#include <stdexcept>
#include <string>
#include <vector>

#include "rotodom/camera/camera_form.h"
#include "rotodom/camera/ros_camera_info.h"

namespace rotslam {
namespace {

// Keys of the same thing: in calibrators' files, in ROS 1 and in ROS 2 messages.
const std::vector<std::string> kMatrixKeys = {"camera_matrix", "K", "k"};
const std::vector<std::string> kDistortionKeys = {"distortion_coefficients", "D", "d"};
const std::vector<std::string> kProjectionKeys = {"projection_matrix", "P", "p"};

std::string KeyOf(const Section& section, const std::vector<std::string>& keys) {
  return section.FirstOf(keys).value_or(keys.front());
}

RosCameraInfo ReadInfo(const Section& section) {
  RosCameraInfo info;
  const std::string width = KeyOf(section, {"image_width", "width"});
  const std::string height = KeyOf(section, {"image_height", "height"});
  ReadSize(section, width, height, info.width, info.height);
  if (section.Has("distortion_model")) info.distortion_model = section.Text("distortion_model");
  info.D = section.Numbers(KeyOf(section, kDistortionKeys));
  // Calibrators that say no model mean OpenCV's.
  if (!section.Has("distortion_model") && !info.D.empty()) info.distortion_model = "plumb_bob";
  const std::vector<double> K =
      section.Numbers(KeyOf(section, kMatrixKeys), {9}, "fx 0 cx 0 fy cy 0 0 1");
  std::copy(K.begin(), K.end(), info.K.begin());
  if (section.HasAny(kProjectionKeys)) {
    const std::vector<double> P =
        section.Numbers(KeyOf(section, kProjectionKeys), {12}, "fx 0 cx Tx 0 fy cy Ty 0 0 1 0");
    std::copy(P.begin(), P.end(), info.P.begin());
  }
  info.binning_x = section.PixelsOrZero("binning_x");
  info.binning_y = section.PixelsOrZero("binning_y");
  if (section.Has("roi")) {
    const Section roi = section.Map("roi");
    info.roi_x = roi.PixelsOrZero("x_offset");
    info.roi_y = roi.PixelsOrZero("y_offset");
    ReadSize(roi, "width", "height", info.roi_width, info.roi_height);
  }
  return info;
}

// CameraOf with the file and the line of the field that it complains about.
Camera ReadRosCamera(const Section& section, bool is_rectified) {
  const RosCameraInfo info = ReadInfo(section);
  try {
    return CameraOf(info, is_rectified);
  } catch (const std::runtime_error& error) {
    const std::string reason = error.what();
    std::string key = KeyOf(section, kMatrixKeys);
    if (reason.starts_with("D ")) key = KeyOf(section, kDistortionKeys);
    if (reason.starts_with("P ")) key = KeyOf(section, kProjectionKeys);
    if (reason.starts_with("distortion_model")) key = "distortion_model";
    FailAt(section.file(), section.Line(key), reason);
  }
}

CameraFile ReadRos(const CameraDocument& document) {
  const Section section = document.root();
  CameraFile file;
  file.first_is_default = true;  // images are as the camera gives them, unless somebody says else
  file.Add("raw", [&] { return ReadRosCamera(section, false); });
  if (!section.HasAny(kProjectionKeys)) return file;
  file.Add("rectified", [&] { return ReadRosCamera(section, true); });
  const bool can_be_meant = file.cameras[1].problem.empty();
  const bool differs = file.cameras[0].camera != file.cameras[1].camera;
  if (!can_be_meant) file.cameras.pop_back();
  if (can_be_meant && differs) {
    file.notes.push_back(
        KeyOf(section, kMatrixKeys) + " and " + KeyOf(section, kDistortionKeys) +
        " are used; for rectified images (image_rect) take the camera `rectified`");
  }
  if (section.PixelsOrZero("binning_x") > 1 || section.PixelsOrZero("binning_y") > 1 ||
      (section.HasMap("roi") && section.Map("roi").PixelsOrZero("width") > 0)) {
    file.notes.push_back("binning and roi are applied: the images are " +
                         std::to_string(file.cameras[0].camera.width) + "x" +
                         std::to_string(file.cameras[0].camera.height));
  }
  return file;
}

}  // namespace

namespace forms {

CameraForm CameraFormRos() {
  CameraForm form;
  form.name = "ROS camera_info";
  form.description =
      "ost.yaml of the calibrator (`camera_matrix`, `distortion_model`, `projection_matrix`), or a "
      "message CameraInfo as `ros2 topic echo` prints it (K, D, P)";
  form.file_names = {"ost.yaml", "camera_info.yaml"};
  form.recognises = [](const CameraDocument& document) {
    const Section root = document.root();
    return root.HasAny({"distortion_model", "projection_matrix"}) && root.HasAny(kMatrixKeys) &&
           !root.HasAny({"camera_model", "model_type", "sfm_data_version"});
  };
  form.read = ReadRos;
  return form;
}

}  // namespace forms
}  // namespace rotslam
