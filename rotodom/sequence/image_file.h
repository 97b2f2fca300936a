#pragma once

#include <filesystem>
#include <string>

#include <opencv2/core/mat.hpp>

namespace rotslam {

/// An image of 8 bits and 1 or 3 channels (blue, green, red); or an empty one, and why.
struct DecodedImage {
  cv::Mat image;
  std::string problem;  // in one line; empty when the image is not
};

/// Reads an image of 8 or 16 bits as its pixels lie: the orientation that EXIF data ask for is not
/// applied, transparency is dropped. Damaged and cut off PNG and JPEG files are noticed, where the
/// decoder would fill in grey; so are headers that claim far more pixels than the file can hold,
/// before memory is taken for them. Whatever the file holds, this does not throw.
DecodedImage ReadImageFile(const std::filesystem::path& file);

/// The same for pixels in memory.
DecodedImage ToEightBits(cv::Mat image);

}  // namespace rotslam
