#include "rotodom/sequence/video/video_orientation.h"

#include <algorithm>
#include <cmath>

#include <opencv2/core.hpp>

namespace rotslam {

std::optional<PictureOrientation> OrientationOf(const DisplayMatrix& matrix) {
  // The tangent of one degree, as far as ffmpeg lets an angle be off.
  constexpr double kTolerance = 0.0175;
  const double a = matrix[0];
  const double b = matrix[1];
  const double c = matrix[3];
  const double d = matrix[4];
  const auto is_diagonal = [&](double m00, double m01, double m10, double m11) {
    const double least = std::min(std::abs(m00), std::abs(m11));
    return least > 0.0 && std::max(std::abs(m01), std::abs(m10)) < kTolerance * least;
  };
  if (is_diagonal(a, b, c, d)) return PictureOrientation{false, a < 0.0, d < 0.0};
  if (is_diagonal(b, a, d, c)) return PictureOrientation{true, c < 0.0, b < 0.0};
  return std::nullopt;
}

cv::Mat Upright(const cv::Mat& stored, const PictureOrientation& orientation) {
  if (orientation.IsAsStored()) return stored;
  cv::Mat image = stored;
  if (orientation.is_transposed) cv::transpose(stored, image);
  if (orientation.flips_x || orientation.flips_y) {
    const int code = orientation.flips_x ? (orientation.flips_y ? -1 : 1) : 0;
    cv::Mat flipped;
    cv::flip(image, flipped, code);
    image = flipped;
  }
  return image;
}

ReadoutStart SideOfFirstRow(const PictureOrientation& orientation) {
  if (orientation.is_transposed) {
    return orientation.flips_x ? ReadoutStart::kRight : ReadoutStart::kLeft;
  }
  return orientation.flips_y ? ReadoutStart::kBottom : ReadoutStart::kTop;
}

std::string Describe(const PictureOrientation& orientation) {
  const auto& [is_transposed, flips_x, flips_y] = orientation;
  if (is_transposed) {
    if (flips_x && flips_y) return "transposed and turned by 180 degrees";
    if (flips_x) return "turned by 90 degrees clockwise";
    if (flips_y) return "turned by 90 degrees counterclockwise";
    return "transposed";
  }
  if (flips_x && flips_y) return "turned by 180 degrees";
  if (flips_x) return "mirrored left to right";
  if (flips_y) return "mirrored top to bottom";
  return "as stored";
}

}  // namespace rotslam
