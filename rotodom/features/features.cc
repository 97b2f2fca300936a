#include "rotodom/features/features.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <opencv2/imgproc.hpp>

#include "rotodom/types/options.h"

namespace rotslam {
namespace {

std::array<std::uint8_t, 3> ColourAt(const cv::Mat& image, const Eigen::Vector2d& position) {
  const int x = std::clamp(static_cast<int>(std::lround(position.x())), 0, image.cols - 1);
  const int y = std::clamp(static_cast<int>(std::lround(position.y())), 0, image.rows - 1);
  if (image.channels() == 1) {
    const std::uint8_t grey = image.at<std::uint8_t>(y, x);
    return {grey, grey, grey};
  }
  const cv::Vec3b bgr = image.at<cv::Vec3b>(y, x);
  return {bgr[2], bgr[1], bgr[0]};
}

void CheckImage(const cv::Mat& image, const std::string& caller) {
  if (image.empty() || image.depth() != CV_8U || (image.channels() != 1 && image.channels() != 3)) {
    throw std::invalid_argument(caller + ": the image must be 8-bit with one or three channels");
  }
}

}  // namespace

std::optional<std::string> FeatureOptions::Problem() const {
  if (max_features < 50) return OutOfRange("max_features", max_features, "at least 50");
  if (num_levels < 1 || num_levels > 16) return OutOfRange("num_levels", num_levels, "1 to 16");
  if (!(scale_factor > 1.0 && scale_factor <= 2.0)) {
    return OutOfRange("scale_factor", scale_factor, "above 1 and at most 2");
  }
  if (min_fast_threshold < 1)
    return OutOfRange("min_fast_threshold", min_fast_threshold, "positive");
  if (fast_threshold < min_fast_threshold) {
    return OutOfRange("fast_threshold", fast_threshold, "at least min_fast_threshold");
  }
  if (!(min_distance_px >= 0.0 && min_distance_px <= 100.0)) {
    return OutOfRange("min_distance_px", min_distance_px, "0 to 100");
  }
  return std::nullopt;
}

cv::Mat ToGrey(const cv::Mat& image) {
  if (image.channels() == 1) return image;
  cv::Mat grey;
  cv::cvtColor(image, grey, cv::COLOR_BGR2GRAY);
  return grey;
}

void ColourFeatures(const cv::Mat& image, Features& features, int first) {
  CheckImage(image, "ColourFeatures");
  features.rgb.resize(features.keypoints_px.size());
  for (int k = first; k < features.size(); ++k) {
    features.rgb[k] = ColourAt(image, features.keypoints_px[k]);
  }
}

Features ExtractFeatures(const MaskedImage& masked,
                         FrameId frame,
                         const Camera& camera,
                         const FeatureOptions& options,
                         int num_threads) {
  const cv::Mat& image = masked.image;
  CheckImage(image, "ExtractFeatures");
  Features features;
  features.frame = frame;
  const ImagePyramid pyramid = BuildPyramid(ToGrey(image), options, masked.mask);
  DetectFeatures(pyramid, camera, options, num_threads, features);
  DescribeFeatures(pyramid, num_threads, features);
  ColourFeatures(image, features);
  return features;
}

}  // namespace rotslam
