#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "rotodom/sequence/decoded_image.h"

namespace rotslam {

/// Pixel values that become 0 and 255; those outside become the nearer of the two.
struct PixelRange {
  double low = 0.0;
  double high = 255.0;
};

/// How pixels of more than 8 bits become 8 bits, the same for all images of a sequence.
struct PixelScale {
  int bits = 16;                      // that 16-bit pixels use: 8, 10, 12, 14 or 16
  PixelRange integers{0.0, 65535.0};  // of 16-bit pixels
  bool is_narrow = false;             // whether `integers` is less than what the bits can hold
  PixelRange floats;                  // of floating-point pixels
};

/// The scale that fits images as DecodeImageFile gives them, those of 8 bits and empty ones left
/// out. The largest 16-bit value tells the bits. Where 16-bit pixels use less than a quarter of
/// what the bits can hold, as those of a thermal camera do, that part becomes 0 to 255. A range
/// holds all pixels but one in a thousand at either end.
PixelScale FindPixelScale(const std::vector<cv::Mat>& images);

/// The conversion of pixels of this depth, in one line: "pixels are 12 bit in 16: divided by 16";
/// nullopt for 8 bits.
std::optional<std::string> Describe(const PixelScale& scale, int depth);

/// Reads an image as its pixels lie, of whatever depth: the orientation that EXIF data or a HEIC
/// file ask for is not applied. Damaged and cut off PNG and JPEG files are noticed, where the
/// decoder would fill in grey; so are headers that claim far more pixels than the file can hold,
/// before memory is taken for them. Whatever the file holds, this does not throw.
DecodedImage DecodeImageFile(const std::filesystem::path& file);

/// The same for the bytes of such a file.
DecodedImage DecodeImageBytes(const std::vector<unsigned char>& bytes);

/// `image` with 8 bits and 1 or 3 channels (blue, green, red); transparency is dropped.
DecodedImage ToEightBits(cv::Mat image, const PixelScale& scale);

/// The same with the scale that the image alone tells.
DecodedImage ToEightBits(cv::Mat image);

/// DecodeImageFile and ToEightBits at once.
DecodedImage ReadImageFile(const std::filesystem::path& file, const PixelScale& scale);
DecodedImage ReadImageFile(const std::filesystem::path& file);

}  // namespace rotslam
