#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <string>

#include <Eigen/Core>

namespace rotslam {

enum class CameraModel {
  kPinhole,      // no distortion
  kRadtan,       // OpenCV: k1 k2 p1 p2 k3
  kEquidistant,  // Kannala-Brandt as in OpenCV's fisheye module: k1 k2 k3 k4
  kRational,     // OpenCV's CALIB_RATIONAL_MODEL: k1 k2 p1 p2 k3 and k4 k5 k6 of the denominator
  kFov,          // Devernay & Faugeras, MVA 2001: w, the field of view of the lens in radians
};

/// All models, in the order of CameraModel.
std::span<const CameraModel> AllCameraModels();

/// `pinhole`, `radtan`, `equidistant`, `rational` or `fov`, as our camera files spell it.
const char* Name(CameraModel model);

/// The names of all models, with commas between, for messages.
std::string CameraModelNames();

/// The model of this name; nullopt: none.
std::optional<CameraModel> FindCameraModel(const std::string& name);

/// Names of a model's distortion coefficients, in the order of Camera::distortion; empty for
/// kPinhole.
std::span<const char* const> DistortionNames(CameraModel model);

/// The side of the image that a rolling shutter exposes first: the top, or another one where images
/// are turned after they were taken, as those of a phone held upright.
enum class ReadoutStart { kTop, kBottom, kLeft, kRight };

/// `top`, `bottom`, `left` or `right`, as our camera files spell it.
const char* Name(ReadoutStart start);

/// The one that has this name; nullopt: none.
std::optional<ReadoutStart> FindReadoutStart(const std::string& name);

/// One calibrated camera. x right, y down, z forward; pixel centres at integer coordinates.
struct Camera {
  CameraModel model = CameraModel::kPinhole;
  int width = 0;  // 0 by 0: the calibration file does not say, the images decide
  int height = 0;
  double fx = 0.0;
  double fy = 0.0;
  double cx = 0.0;
  double cy = 0.0;
  std::array<double, 8> distortion = {};  // as DistortionNames(model) says; zeros behind them
  // Rolling shutter: time from the exposure of the first row to that of the last (of the columns if
  // it starts at a side); 0 for a global shutter.
  double readout_s = 0.0;
  ReadoutStart readout_from = ReadoutStart::kTop;
  bool knows_readout = false;  // as its calibration says; else it is to be found out

  /// Pixel that shows `point_in_cam`; nullopt where the model does not reach (behind the image
  /// plane for all but kEquidistant, beyond the fold of the distortion, and beyond a zero of
  /// kRational's denominator).
  /// @param J  when given, receives d(pixel) / d(point_in_cam); untouched when nullopt.
  std::optional<Eigen::Vector2d> Project(const Eigen::Vector3d& point_in_cam,
                                         Eigen::Matrix<double, 2, 3>* J = nullptr) const;

  /// Unit bearing of a pixel; nullopt where the distortion cannot be inverted. The pixel may lie
  /// outside the image.
  /// Error: Project(Unproject(p)) == p to 1e-9 px where the model is invertible.
  std::optional<Eigen::Vector3d> Unproject(const Eigen::Vector2d& pixel) const;

  /// When the row, or column, of a pixel is exposed, counted from the middle of the frame; seconds,
  /// 0 for a global shutter.
  double ExposureTime(const Eigen::Vector2d& pixel) const;

  /// Pixels per radian near the image centre: the mean of fx and fy.
  double MeanFocal() const { return 0.5 * (fx + fy); }

  /// The first problem with the numbers, in one line; nullopt when all is well.
  std::optional<std::string> Problem() const;

  bool operator==(const Camera&) const = default;
};

/// One line for people: model, fx, fy, cx, cy, distortion, size.
std::string Describe(const Camera& camera);

}  // namespace rotslam
