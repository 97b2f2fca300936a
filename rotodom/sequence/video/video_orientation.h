#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include <opencv2/core/mat.hpp>

#include "rotodom/camera/camera.h"

namespace rotslam {

/// How stored pictures are shown: first transposed (rows become columns), then mirrored. All eight
/// ways to lay a picture on its sides.
struct PictureOrientation {
  bool is_transposed = false;
  bool flips_x = false;  // left and right change places
  bool flips_y = false;  // top and bottom change places

  bool IsAsStored() const { return !is_transposed && !flips_x && !flips_y; }
  bool operator==(const PictureOrientation&) const = default;
};

/// The matrix of a video track: a b u, c d v, x y w, as QuickTime has it. Pixel (p, q) is shown at
/// (a p + c q + x, b p + d q + y); y goes down.
using DisplayMatrix = std::array<std::int32_t, 9>;

/// The orientation that `matrix` asks for. Translations and positive scales are of no account.
/// @return  nullopt where it turns by no multiple of 90 degrees (to 1 degree), or is singular.
std::optional<PictureOrientation> OrientationOf(const DisplayMatrix& matrix);

/// `stored` as it is shown. Shares its pixels where nothing is to be done.
cv::Mat Upright(const cv::Mat& stored, const PictureOrientation& orientation);

/// The side where the first row of the stored picture is shown. Sensors are read out from there.
ReadoutStart SideOfFirstRow(const PictureOrientation& orientation);

/// In words: `turned by 90 degrees clockwise`, `mirrored left to right`, `as stored`.
std::string Describe(const PictureOrientation& orientation);

}  // namespace rotslam
