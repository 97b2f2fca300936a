#pragma once

#include <array>
#include <filesystem>
#include <optional>

#include <opencv2/core.hpp>

namespace rotslam {

/// Files of a photometric calibration as TUM-mono and DSO have them; either may be missing.
struct PhotometricFiles {
  std::optional<std::filesystem::path> inverse_response;  // pcalib.txt
  std::optional<std::filesystem::path> vignette;          // vignette.png
};

/// Takes a lens's vignetting out of images.
///
/// A pixel value is I = G(V L): the camera's response G of the light L that the lens weakens by
/// V. The correction gives G(L), not L: tones stay as the camera made them, because in 8 bits the
/// light itself would leave dark parts without contrast.
/// Source:  Engel, Usenko and Cremers, A Photometrically Calibrated Benchmark For Monocular Visual
///          Odometry, 2016, for the model and the files.
class PhotometricCorrection {
 public:
  /// @param files  without an inverse response, G is the identity; a vignette must be there.
  /// Throws std::runtime_error with file, line and reason: not 256 increasing numbers, an image
  /// that cannot be read or is black, one of another size than `image_size`.
  PhotometricCorrection(const PhotometricFiles& files, const cv::Size& image_size);

  /// @param image  8 bits, 1 or 3 channels, of that size.
  void Apply(cv::Mat& image) const;

 private:
  static constexpr int kLevels = 4096;  // of light, so that no tone of 8 bits is missed

  cv::Mat gain_;                                  // CV_32F, 1 / V
  std::array<float, 256> light_ = {};             // of each tone, 0 to kLevels - 1
  std::array<unsigned char, kLevels> tone_ = {};  // of each level of light
};

}  // namespace rotslam
