#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "rotodom/camera/camera.h"

namespace rotslam {

/// Reads one camera from a calibration file, whose kind is recognised by its content:
///   ours          YAML, see below
///   ORB-SLAM      YAML with `Camera.fx` or `Camera1.fx`; types PinHole, Rectified, KannalaBrandt8
///   Kalibr        camera chain with `cam0`; pinhole with radtan, equidistant or none
///   EuRoC         `sensor.yaml`; pinhole with radial-tangential, equidistant or none
///   KITTI         `calib.txt`: the row P0 (all cameras of a rectified sequence share it); no size
///   COLMAP        `cameras.txt`: SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV,
///                 FULL_OPENCV, FOV, SIMPLE_RADIAL_FISHEYE, RADIAL_FISHEYE, OPENCV_FISHEYE;
///                 several lines must agree. COLMAP puts pixel centres at one half:
///                 cx and cy lose 0.5.
/// Of a chain of cameras, the first. Foreign radtan files whose coefficients are all zero give
/// kPinhole. A folder stands for the first of `camera.yaml`, `calib.txt`, `sensor.yaml`,
/// `mav0/cam0/sensor.yaml` and `cameras.txt` in it.
///
/// Our own form:
///   model: radtan                    # pinhole, radtan, equidistant, rational or fov
///   width: 752                       # pixels; both 0 or left out: the images decide
///   height: 480
///   fx: 458.654                      # pixels; pixel centres at integer coordinates, as in OpenCV
///   fy: 457.296
///   cx: 367.215
///   cy: 248.375
///   distortion: [-0.283, 0.074, 0.00019, 1.8e-05, 0]
///   readout_s: 0.02                  # rolling shutter, first row to last; 0: global; left out:
///   not
///                                    # known, and 0
///   readout_from: top                # its first row: top, bottom, left or right; left out: top
/// `distortion` is k1 k2 p1 p2 [k3] for radtan, k1 k2 k3 k4 for equidistant, k1 k2 p1 p2 k3 k4 k5
/// k6 for rational, w in radians for fov, empty or left out for pinhole. Unknown keys are errors.
///
/// Throws std::runtime_error in one line that names file and key: no such file, kind or model not
/// known, a number missing, malformed, not finite, or not positive where it has to be.
Camera ReadCamera(const std::filesystem::path& path);

/// A file and, after a colon, the camera in it: "calib.yaml:cam1". (A path that exists as it stands
/// is a file without a name.)
struct CameraReference {
  std::filesystem::path file;
  std::string name;
};

/// The camera of the file that is named, or that belongs to the images in `image_folder`.
Camera ReadCamera(const CameraReference& reference, const std::filesystem::path& image_folder = {});

/// One camera of a COLMAP model from the words of its line in `cameras.txt`: id, model, width,
/// height, parameters. Throws as ReadCamera does.
Camera ReadColmapCamera(const std::filesystem::path& file, const std::vector<std::string>& words);

/// `camera` in our own form; ReadCamera gives back the very same numbers.
std::string CameraYaml(const Camera& camera);

/// Writes CameraYaml(camera), beside first, then renamed. Throws std::runtime_error when it cannot,
/// std::invalid_argument when camera.Problem().
void WriteCameraYaml(const std::filesystem::path& file, const Camera& camera);

}  // namespace rotslam
