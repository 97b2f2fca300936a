#pragma once

#include <string>

#include <opencv2/core/mat.hpp>

namespace rotslam {

/// An image, or an empty one, and why.
struct DecodedImage {
  cv::Mat image;
  std::string problem;  // in one line; empty when the image is not
};

}  // namespace rotslam
