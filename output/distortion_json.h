#pragma once

#include "rotodom/camera/camera.h"

namespace rotslam {

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
