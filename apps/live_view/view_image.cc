#include "apps/live_view/view_image.h"

#include <algorithm>
#include <cstdint>
#include <string_view>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "apps/page/encoded_array.h"

namespace rotslam {
namespace {

// Longer side of what is sent. The page shows it some 300 pixels wide; more would cost more than
// all else together.
constexpr int kMaxSide = 480;
constexpr int kJpegQuality = 70;

}  // namespace

nlohmann::ordered_json EncodedViewImage(const ViewImage& image) {
  cv::Mat small = image.image;
  const int side = std::max(small.cols, small.rows);
  if (side > kMaxSide) {
    const double scale = static_cast<double>(kMaxSide) / side;
    cv::resize(image.image, small, {}, scale, scale, cv::INTER_AREA);
  }
  std::vector<unsigned char> jpeg;
  cv::imencode(".jpg", small, jpeg, {cv::IMWRITE_JPEG_QUALITY, kJpegQuality});
  std::vector<std::uint16_t> points;
  points.reserve(2 * image.points_px.size());
  const Eigen::Vector2d size(image.image.cols, image.image.rows);
  for (const Eigen::Vector2d& point_px : image.points_px) {
    const Eigen::Vector2d share = (point_px.array() + 0.5) / size.array();
    if (!(share.minCoeff() >= 0.0 && share.maxCoeff() <= 1.0)) continue;
    for (const double value : share) points.push_back(static_cast<std::uint16_t>(65535.0 * value));
  }
  const std::string_view bytes(reinterpret_cast<const char*>(jpeg.data()), jpeg.size());
  return {{"frame", image.frame}, {"jpeg", Base64(bytes)}, {"points", EncodedArray(points, 2)}};
}

}  // namespace rotslam
