#pragma once

#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "rotodom/camera/camera.h"
#include "rotodom/camera/section.h"

namespace rotslam {

/// `camera` with the simplest model that has its numbers: rational without a denominator is radtan,
/// radtan and FOV without distortion are pinhole.
Camera Simplified(Camera camera);

/// Sets model and coefficients as cv::projectPoints reads them: none, or 4, 5, 8, 12 or 14 values
/// k1 k2 p1 p2 [k3 [k4 k5 k6 [s1 s2 s3 s4 [tx ty]]]]. Returns what is wrong in words that follow a
/// key: another count, or a thin prism or tilt that is not zero.
[[nodiscard]] std::optional<std::string> SetOpenCvDistortion(std::span<const double> values,
                                                             Camera& camera);

/// Sets kEquidistant and k1 k2 k3 k4. Returns what is wrong as SetOpenCvDistortion does.
[[nodiscard]] std::optional<std::string> SetFisheyeDistortion(std::span<const double> values,
                                                              Camera& camera);

/// Sets kFov and w. Returns what is wrong as SetOpenCvDistortion does.
[[nodiscard]] std::optional<std::string> SetFovDistortion(std::span<const double> values,
                                                          Camera& camera);

/// Sets fx, fy, cx and cy from a 3 by 3 matrix, by rows. Returns what is wrong as
/// SetOpenCvDistortion does: not fx 0 cx 0 fy cy 0 0 1.
[[nodiscard]] std::optional<std::string> SetMatrix(std::span<const double> K, Camera& camera);

/// Reads the distortion of files that give every coefficient a key of its own: those that `model`
/// has by their names in DistortionNames; missing ones are 0. Every other key of `others`, or of
/// k1 to k6, p1 and p2, that is there has to be 0. For kRadtan, k4 to k6 make kRational.
/// Throws std::runtime_error with file, line and key.
void ReadNamedDistortion(const Section& section,
                         CameraModel model,
                         const std::vector<std::string>& others,
                         Camera& camera);

/// Reads a matrix and its coefficients as OpenCV and programs around it write them. The key of the
/// coefficients may be empty: none.
/// Throws std::runtime_error with file, line and key.
void ReadMatrixAndDistortion(const Section& section,
                             const std::string& matrix_key,
                             const std::string& distortion_key,
                             bool is_fisheye,
                             Camera& camera);

}  // namespace rotslam
