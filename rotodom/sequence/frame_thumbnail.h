#pragma once

#include <cstdint>
#include <vector>

#include <opencv2/core/mat.hpp>

namespace rotslam {

/// The grey values of a small copy of an image, row by row; empty where there is no image.
/// Compression and scaling of the image change them little.
using FrameThumbnail = std::vector<std::uint8_t>;

inline constexpr int kThumbnailWidth = 32;
inline constexpr int kThumbnailHeight = 24;

/// Each value is the mean over its part of the image, of which some 240 rows are read.
/// @param image  8-bit, 1 or 3 channels (blue, green, red); may be empty.
FrameThumbnail MakeFrameThumbnail(const cv::Mat& image);

}  // namespace rotslam
