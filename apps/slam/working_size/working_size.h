#pragma once

#include <string>

#include <opencv2/core.hpp>

#include "rotodom/camera/camera.h"
#include "rotodom/masks/mask.h"

namespace rotslam {

/// "1280x720".
std::string SizeText(const cv::Size& size);

/// The size at which large images are worked with. Corners, patches and thresholds are some pixels
/// large, which suits images of 640 to 1,600 pixels. Larger images of the same lens show the same
/// scene with less contrast per pixel, so that they are reduced first.
///
/// The scale is 4 / n with a whole n: both axes have exactly the same one. Rows and columns at the
/// lower and right edge that do not fill n pixels are left out. The largest such scale is taken
/// that consists of a whole reduction, over which pixels are averaged, and one by less than 2.
class WorkingSize {
 public:
  /// Images are worked with as they are.
  WorkingSize() = default;
  /// @param image_size   of the original images.
  /// @param max_side_px  the longer side is at most this; images within it are not reduced.
  WorkingSize(const cv::Size& image_size, int max_side_px);

  bool IsReduced() const { return size_ != image_size_; }
  /// Working pixels per pixel of the original images; 1 where they are not reduced.
  double scale() const { return scale_; }
  /// Of the images that are worked with.
  const cv::Size& size() const { return size_; }
  const cv::Size& image_size() const { return image_size_; }

  /// The reduced image, edges at their reduced places; as it is where nothing is reduced or it is
  /// empty. Throws std::invalid_argument where it has not the size of the original images.
  cv::Mat Reduced(const cv::Mat& image) const;
  /// A working pixel is masked where any part of it is.
  Mask Reduced(const Mask& mask) const;
  /// The camera of the reduced images, which sees every point at the reduced pixel.
  Camera Reduced(Camera camera) const;

  /// The mask of the original images that belongs to one of reduced images.
  Mask Original(const Mask& reduced) const;
  /// The camera of the original images that belongs to one of reduced images.
  Camera Original(Camera reduced) const;
  /// The same. Values that are still those of Reduced(given) become those of `given` to the last
  /// bit.
  Camera Original(const Camera& reduced, const Camera& given) const;

  /// Levels of a pyramid that lie between the original and the reduced images.
  /// @param level_scale  of each level against the one before.
  int NumLevelsBelow(double level_scale) const;

 private:
  cv::Size image_size_;
  cv::Size used_size_;  // of the part of the original images that is worked with
  cv::Size size_;
  int whole_factor_ = 1;  // of the reduction
  double scale_ = 1.0;
};

}  // namespace rotslam
