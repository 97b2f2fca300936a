#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "rotodom/camera/camera.h"
#include "rotodom/camera/lens_sigmas.h"

namespace rotslam {

/// One camera of a calibration file.
struct NamedCamera {
  std::string
      name;  // "cam0", "P2", "Camera1", "rectified"; empty: the file has one, without a name
  Camera camera;
  // Set: the file gives the horizontal angle of view in place of a focal length, so that fx, fy, cx
  // and cy follow from the size of the images; `camera` has none of them. See AtSize.
  std::optional<double> view_angle_x_rad;
  // Set: the camera cannot be read; the error in one line, thrown once somebody asks for it.
  std::string problem;
  // How well the lens is known; nullopt: the file does not say.
  std::optional<LensSigmas> sigmas = {};
  // Parts of the image that show no scene, px: corner points of polygons.
  std::vector<std::vector<Eigen::Vector2d>> masked_px = {};
};

/// The content of a calibration file.
struct CameraFile {
  std::string form;                  // name of the form that it was taken for: "ORB-SLAM YAML"
  std::vector<NamedCamera> cameras;  // at least one, in the order of the file
  // Of cameras that differ, the form itself says that the first is meant.
  bool first_is_default = false;
  std::vector<std::string> notes;  // what was ignored or assumed, one line each

  /// Adds the camera that `read` returns; what it throws becomes the camera's problem, so that the
  /// other cameras of the file are still of use.
  void Add(const std::string& name, const std::function<Camera()>& read);
};

/// The camera for images of this size: what its angle of view means there. As it is where it has no
/// such angle.
Camera AtSize(const NamedCamera& camera, int width, int height);

}  // namespace rotslam
