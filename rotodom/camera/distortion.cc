#include "rotodom/camera/distortion.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>

#include "rotodom/types/text_file.h"

namespace rotslam {
namespace {

std::string HasValues(std::size_t count, const std::string& wanted) {
  return "has " + std::to_string(count) + " values, must have " + wanted;
}

}  // namespace

Camera Simplified(Camera camera) {
  auto& d = camera.distortion;
  if (camera.model == CameraModel::kRational && d[5] == 0.0 && d[6] == 0.0 && d[7] == 0.0) {
    camera.model = CameraModel::kRadtan;
  }
  const bool is_empty = std::all_of(d.begin(), d.end(), [](double value) { return value == 0.0; });
  if (is_empty && (camera.model == CameraModel::kRadtan || camera.model == CameraModel::kFov)) {
    camera.model = CameraModel::kPinhole;
  }
  return camera;
}

std::optional<std::string> SetOpenCvDistortion(std::span<const double> values, Camera& camera) {
  static constexpr std::array<const char*, 6> kBeyond = {"s1", "s2", "s3", "s4", "tau_x", "tau_y"};
  const std::size_t n = values.size();
  if (n != 0 && n != 4 && n != 5 && n != 8 && n != 12 && n != 14) {
    return HasValues(n, "4, 5 or 8: k1 k2 p1 p2 [k3 [k4 k5 k6]]");
  }
  camera.distortion = {};
  std::copy_n(values.begin(), std::min(n, camera.distortion.size()), camera.distortion.begin());
  camera.model = CameraModel::kRational;
  camera = Simplified(camera);
  for (std::size_t k = camera.distortion.size(); k < n; ++k) {
    if (values[k] == 0.0) continue;
    return std::string("has ") + kBeyond[k - camera.distortion.size()] + " = " +
           FormatNumber("%.6g", values[k]) +
           ", a thin prism or tilted sensor, which is not supported; calibrate without it";
  }
  return std::nullopt;
}

std::optional<std::string> SetFisheyeDistortion(std::span<const double> values, Camera& camera) {
  if (values.size() != 4) return HasValues(values.size(), "4: k1 k2 k3 k4 of a fisheye lens");
  camera.model = CameraModel::kEquidistant;
  camera.distortion = {};
  std::copy(values.begin(), values.end(), camera.distortion.begin());
  return std::nullopt;
}

std::optional<std::string> SetFovDistortion(std::span<const double> values, Camera& camera) {
  if (values.size() != 1) return HasValues(values.size(), "1: w");
  if (!(values[0] >= 0.0 && values[0] < std::numbers::pi)) {
    return "is " + FormatNumber("%.6g", values[0]) +
           ", must be an angle of view from 0 to pi radians";
  }
  camera.model = CameraModel::kFov;
  camera.distortion = {values[0]};
  camera = Simplified(camera);
  return std::nullopt;
}

std::optional<std::string> SetMatrix(std::span<const double> K, Camera& camera) {
  if (K.size() != 9) return HasValues(K.size(), "9: fx 0 cx 0 fy cy 0 0 1");
  if (K[1] != 0.0) {
    return "has a skew of " + FormatNumber("%.6g", K[1]) + ", which is not supported; must be 0";
  }
  if (K[3] != 0.0 || K[6] != 0.0 || K[7] != 0.0 || K[8] != 1.0) {
    return "is not of the form fx 0 cx 0 fy cy 0 0 1";
  }
  for (const std::size_t k : {0, 4}) {
    if (K[k] > 0.0) continue;
    return "has the focal length " + FormatNumber("%.6g", K[k]) + ", must be positive";
  }
  camera.fx = K[0];
  camera.fy = K[4];
  camera.cx = K[2];
  camera.cy = K[5];
  return std::nullopt;
}

void ReadNamedDistortion(const Section& section,
                         CameraModel model,
                         const std::vector<std::string>& others,
                         Camera& camera) {
  camera.model = model == CameraModel::kRadtan ? CameraModel::kRational : model;
  camera.distortion = {};
  const auto names = DistortionNames(camera.model);
  for (std::size_t k = 0; k < names.size(); ++k) {
    camera.distortion[k] = section.NumberOr(names[k], 0.0);
  }
  std::vector<std::string> rest = {"k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2"};
  rest.insert(rest.end(), others.begin(), others.end());
  for (const std::string& key : rest) {
    const auto is_key = [&](const char* name) { return key == name; };
    if (std::any_of(names.begin(), names.end(), is_key) || !section.Has(key)) continue;
    if (section.Number(key) == 0.0) continue;
    section.FailValue(key,
                      std::string("but a camera of this model, ") + Name(model) +
                          ", has no such coefficient; correct the model or remove the line");
  }
  camera = Simplified(camera);
}

void ReadMatrixAndDistortion(const Section& section,
                             const std::string& matrix_key,
                             const std::string& distortion_key,
                             bool is_fisheye,
                             Camera& camera) {
  if (const auto problem = SetMatrix(section.Numbers(matrix_key), camera)) {
    section.Fail(matrix_key, *problem);
  }
  std::vector<double> values;
  if (!distortion_key.empty()) values = section.Numbers(distortion_key);
  const auto problem =
      is_fisheye ? SetFisheyeDistortion(values, camera) : SetOpenCvDistortion(values, camera);
  if (problem) section.Fail(distortion_key.empty() ? matrix_key : distortion_key, *problem);
}

}  // namespace rotslam
