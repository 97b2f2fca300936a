#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include <opencv2/core.hpp>

#include "output/tables/summary.h"
#include "rotodom/camera/camera.h"
#include "rotodom/sequence/sequence.h"

namespace rotslam {

/// The focal length that the estimate of a lens without a calibration starts from.
struct FocalGuess {
  double focal_px = 0.0;
  bool is_from_exif = false;  // else GuessFocalLength
  bool is_found = false;      // the images have told the lens
};

/// The focal length as if a film camera had taken the image, mm, from the EXIF data of a JPEG file;
/// nullopt where it does not say.
std::optional<double> FilmFocalLength(const std::filesystem::path& image);

/// The focal length by the first image's EXIF data. Without these it is GuessFocalLength.
FocalGuess GuessFocal(const std::filesystem::path& sequence,
                      const SequenceOptions& options,
                      const cv::Size& image_size);

/// The warning to the user, and the entries of summary.json.
std::string WarningOf(const FocalGuess& guess, const Camera& refined);
SummaryTable SummaryOf(const FocalGuess& guess, const Camera& refined);

}  // namespace rotslam
