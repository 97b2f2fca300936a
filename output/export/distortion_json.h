#pragma once

#include <filesystem>
#include <stdexcept>
#include <string>

#include "rotodom/camera/camera.h"

namespace rotslam {

/// Throws std::runtime_error in one line, with the file that is not written, for a lens that
/// `system` has no model of: kFov, and kRational where its denominator says something. The others
/// are k1, k2, p1, p2, k3, or the four of a fisheye.
inline void RefuseLensBeyondRadtan(const std::filesystem::path& file,
                                   const Camera& camera,
                                   const std::string& system) {
  const auto& d = camera.distortion;
  const bool has_denominator = d[5] != 0.0 || d[6] != 0.0 || d[7] != 0.0;
  const bool is_rational = camera.model == CameraModel::kRational && has_denominator;
  if (!is_rational && camera.model != CameraModel::kFov) return;
  throw std::runtime_error(file.string() + ": is not written: " + system +
                           " has no camera model for " +
                           (is_rational ? "a rational lens (k4 k5 k6)" : "a FOV lens (w)") +
                           "; --undistort writes images without distortion, and COLMAP has a model "
                           "of it: export --to colmap");
}

/// Adds k1 to k4 of a fisheye lens, or k1, k2, p1, p2, k3 of any other, as OpenCV orders them.
template <typename Json>
void AddDistortion(const Camera& camera, Json& json) {
  const auto& d = camera.distortion;
  json["k1"] = d[0];
  json["k2"] = d[1];
  if (camera.model == CameraModel::kEquidistant) {
    json["k3"] = d[2];
    json["k4"] = d[3];
  } else {
    json["p1"] = d[2];
    json["p2"] = d[3];
    json["k3"] = d[4];
  }
}

}  // namespace rotslam
