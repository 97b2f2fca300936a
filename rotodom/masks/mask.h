#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core.hpp>

namespace rotslam {

/// Corner points of a polygon, px.
using MaskPolygon = std::vector<Eigen::Vector2d>;

/// The pixels of an image that show no part of the scene: text on the picture, dirt on the lens,
/// people, the sky. As an image it follows COLMAP's convention: black (0) is ignored, every other
/// value is used. Copies share their pixels.
class Mask {
 public:
  /// Nothing is masked.
  Mask() = default;
  /// @param image  8-bit, one channel; pixels of value 0 are masked. Throws std::invalid_argument
  ///               for another type.
  explicit Mask(const cv::Mat& image);

  bool IsEmpty() const { return distance_px_.empty(); }
  /// Size of the image; 0 by 0 where nothing is masked.
  cv::Size size() const { return distance_px_.size(); }
  /// Masked share of the image, 0 to 1.
  double Share() const;

  /// Whether a masked pixel lies within `reach_px` of a position; false outside the image.
  /// @param reach_px  less than 255.
  bool Covers(const Eigen::Vector2d& px, double reach_px) const {
    if (distance_px_.empty()) return false;
    const int x = cvRound(px.x());
    const int y = cvRound(px.y());
    if (x < 0 || y < 0 || x >= distance_px_.cols || y >= distance_px_.rows) return false;
    return distance_px_.at<std::uint8_t>(y, x) <= reach_px;
  }

  /// 0 where masked, 255 elsewhere; empty where nothing is masked.
  cv::Mat ToImage() const;

  template <class Archive>
  void Transfer(Archive& archive) {
    int rows = distance_px_.rows;
    int cols = distance_px_.cols;
    std::vector<std::uint8_t> bytes;
    if (!distance_px_.empty()) {
      bytes.assign(distance_px_.data, distance_px_.data + distance_px_.total());
    }
    archive(rows, cols, bytes);
    const bool is_whole =
        rows > 0 && cols > 0 &&
        static_cast<std::size_t>(rows) * static_cast<std::size_t>(cols) == bytes.size();
    distance_px_ = is_whole ? cv::Mat(rows, cols, CV_8U, bytes.data()).clone() : cv::Mat();
  }

 private:
  cv::Mat distance_px_;  // from each pixel to the nearest masked one, 8-bit, at most 255
};

/// Masks what either of two masks does. Throws std::invalid_argument where their sizes differ.
Mask Union(const Mask& a, const Mask& b);

/// Masks the inside of polygons.
Mask MaskOfPolygons(const std::vector<MaskPolygon>& polygons, const cv::Size& image_size);

/// An image with the pixels that are to be ignored. Converts from an image of which all is used.
struct MaskedImage {
  MaskedImage(const cv::Mat& pixels) : image(pixels) {}  // NOLINT(google-explicit-constructor)
  MaskedImage(const cv::Mat& pixels, const Mask& ignored) : image(pixels), mask(ignored) {}

  cv::Mat image;  // 8-bit, one or three channels (BGR)
  Mask mask;      // of the image's size, or empty
};

}  // namespace rotslam
