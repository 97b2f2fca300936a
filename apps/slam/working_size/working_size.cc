#include "apps/slam/working_size/working_size.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include <opencv2/imgproc.hpp>

namespace rotslam {
namespace {

// Numerator of the scale.
constexpr int kNumerator = 4;

// The whole part of a reduction by denominator / kNumerator: the largest divisor of the denominator
// that leaves no enlargement.
int WholeFactor(int denominator) {
  int factor = denominator / kNumerator;
  while (denominator % factor != 0) --factor;
  return factor;
}

// The least denominator from this one on whose reduction is a whole one followed by less than 2.
int NextDenominator(int denominator) {
  while (denominator >= 2 * kNumerator * WholeFactor(denominator)) ++denominator;
  return denominator;
}

void RequireSize(const cv::Size& size, const cv::Size& expected, const std::string& what) {
  if (size == expected) return;
  throw std::invalid_argument(what + " is " + SizeText(size) + ", must be " + SizeText(expected));
}

// Where the middle of a pixel lies in an image of another scale.
double Moved(double px, double scale) { return (px + 0.5) * scale - 0.5; }

}  // namespace

std::string SizeText(const cv::Size& size) {
  return std::to_string(size.width) + "x" + std::to_string(size.height);
}

WorkingSize::WorkingSize(const cv::Size& image_size, int max_side_px)
    : image_size_(image_size), used_size_(image_size), size_(image_size) {
  if (max_side_px < 1) throw std::invalid_argument("WorkingSize: max_side_px must be positive");
  const int longer_px = std::max(image_size.width, image_size.height);
  const int shorter_px = std::min(image_size.width, image_size.height);
  if (longer_px <= max_side_px) return;
  const int denominator = NextDenominator((kNumerator * longer_px + max_side_px - 1) / max_side_px);
  if (shorter_px < denominator) return;
  const cv::Size num_blocks(image_size.width / denominator, image_size.height / denominator);
  used_size_ = num_blocks * denominator;
  size_ = num_blocks * kNumerator;
  whole_factor_ = WholeFactor(denominator);
  scale_ = static_cast<double>(kNumerator) / denominator;
}

cv::Mat WorkingSize::Reduced(const cv::Mat& image) const {
  if (!IsReduced() || image.empty()) return image;
  RequireSize(image.size(), image_size_, "the image");
  cv::Mat reduced = image(cv::Rect({}, used_size_));
  if (whole_factor_ > 1) {
    cv::Mat whole;
    cv::resize(reduced, whole, used_size_ / whole_factor_, 0.0, 0.0, cv::INTER_AREA);
    reduced = whole;
  }
  if (reduced.size() == size_) return reduced;
  // Averages over parts of pixels would move edges by up to a tenth of a pixel; this does not.
  cv::Mat result;
  cv::resize(reduced, result, size_, 0.0, 0.0, cv::INTER_LINEAR);
  return result;
}

Mask WorkingSize::Reduced(const Mask& mask) const {
  if (!IsReduced() || mask.IsEmpty()) return mask;
  RequireSize(mask.size(), image_size_, "the mask");
  const cv::Mat used = mask.ToImage()(cv::Rect({}, used_size_));
  cv::Mat reduced;
  cv::resize(used, reduced, size_, 0.0, 0.0, cv::INTER_AREA);
  return Mask(cv::Mat(reduced == 255));
}

Camera WorkingSize::Reduced(Camera camera) const {
  if (!IsReduced()) return camera;
  RequireSize({camera.width, camera.height}, image_size_, "the camera");
  camera.width = size_.width;
  camera.height = size_.height;
  camera.fx *= scale_;
  camera.fy *= scale_;
  camera.cx = Moved(camera.cx, scale_);
  camera.cy = Moved(camera.cy, scale_);
  return camera;
}

Mask WorkingSize::Original(const Mask& reduced) const {
  if (!IsReduced() || reduced.IsEmpty()) return reduced;
  RequireSize(reduced.size(), size_, "the mask");
  cv::Mat image;
  cv::resize(reduced.ToImage(), image, used_size_, 0.0, 0.0, cv::INTER_NEAREST);
  const cv::Size left_out = image_size_ - used_size_;
  cv::copyMakeBorder(image, image, 0, left_out.height, 0, left_out.width, cv::BORDER_REPLICATE);
  return Mask(image);
}

Camera WorkingSize::Original(Camera reduced) const {
  if (!IsReduced()) return reduced;
  RequireSize({reduced.width, reduced.height}, size_, "the camera");
  reduced.width = image_size_.width;
  reduced.height = image_size_.height;
  reduced.fx /= scale_;
  reduced.fy /= scale_;
  reduced.cx = Moved(reduced.cx, 1.0 / scale_);
  reduced.cy = Moved(reduced.cy, 1.0 / scale_);
  return reduced;
}

Camera WorkingSize::Original(const Camera& reduced, const Camera& given) const {
  Camera camera = Original(reduced);
  const Camera before = Reduced(given);
  for (double Camera::*value : {&Camera::fx, &Camera::fy, &Camera::cx, &Camera::cy}) {
    if (reduced.*value == before.*value) camera.*value = given.*value;
  }
  return camera;
}

int WorkingSize::NumLevelsBelow(double level_scale) const {
  return static_cast<int>(std::lround(-std::log(scale_) / std::log(level_scale)));
}

}  // namespace rotslam
