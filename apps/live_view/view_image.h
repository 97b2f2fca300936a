#pragma once

#include <vector>

#include <Eigen/Core>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>

namespace rotslam {

/// A frame's image and the points in it that its pose rests on.
struct ViewImage {
  int frame = 0;
  cv::Mat image;  // 8-bit, one channel or three (blue, green, red)
  std::vector<Eigen::Vector2d> points_px;
};

/// The image for the page, smaller where it is large: "frame", "jpeg" in base64, and "points" as
/// shares of width and height times 65535. Points outside the image are left out.
/// Throws cv::Exception where the image cannot be encoded.
nlohmann::ordered_json EncodedViewImage(const ViewImage& image);

}  // namespace rotslam
