#pragma once

#include <vector>

#include <opencv2/core/mat.hpp>

namespace rotslam {

/// Whether images of this size may be spherical (equirectangular) pictures: twice as wide as high.
bool HasSphericalSize(const cv::Size& size);

/// Whether the images are spherical (equirectangular) pictures, by what they show: the left edge
/// continues the right one, and the top and bottom rows, which show one direction each, are nearly
/// constant. A camera with a lens can give such images only by chance, which is why all images must
/// agree and what proves nothing counts against it: black borders, edges without structure.
/// @param images  some frames of one sequence, 8 bits, 1 or 3 channels; empty ones are left out.
bool AreSpherical(const std::vector<cv::Mat>& images);

}  // namespace rotslam
