#include "rotodom/masks/mask.h"

#include <cmath>
#include <stdexcept>

#include <opencv2/imgproc.hpp>

namespace rotslam {

Mask::Mask(const cv::Mat& image) {
  if (image.empty() || image.type() != CV_8UC1) {
    throw std::invalid_argument("Mask: the image must be 8-bit with one channel");
  }
  if (cv::countNonZero(image) == static_cast<int>(image.total())) return;
  cv::Mat distance_px;
  cv::distanceTransform(image, distance_px, cv::DIST_L2, 3);
  distance_px.convertTo(distance_px_, CV_8U);
}

double Mask::Share() const {
  if (IsEmpty()) return 0.0;
  return 1.0 - static_cast<double>(cv::countNonZero(distance_px_)) /
                   static_cast<double>(distance_px_.total());
}

cv::Mat Mask::ToImage() const {
  if (IsEmpty()) return {};
  return cv::Mat(distance_px_ > 0);
}

Mask Union(const Mask& a, const Mask& b) {
  if (a.IsEmpty()) return b;
  if (b.IsEmpty()) return a;
  if (a.size() != b.size()) throw std::invalid_argument("Union: the masks differ in size");
  return Mask(a.ToImage() & b.ToImage());
}

Mask MaskOfPolygons(const std::vector<MaskPolygon>& polygons, const cv::Size& image_size) {
  cv::Mat image(image_size, CV_8U, cv::Scalar(255));
  for (const MaskPolygon& polygon : polygons) {
    std::vector<cv::Point> corners;
    for (const Eigen::Vector2d& px : polygon) {
      corners.emplace_back(static_cast<int>(std::lround(px.x())),
                           static_cast<int>(std::lround(px.y())));
    }
    if (!corners.empty()) cv::fillPoly(image, std::vector{corners}, cv::Scalar(0));
  }
  return Mask(image);
}

}  // namespace rotslam
