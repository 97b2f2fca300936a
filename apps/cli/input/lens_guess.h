#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>

#include "output/tables/summary.h"
#include "rotodom/camera/camera.h"
#include "rotodom/sequence/sequence.h"

namespace rotslam {

/// The source of the first guess of a focal length.
enum class FocalSource {
  kImageSize,      // GuessFocalLength
  kExif,           // EXIF data of the first image
  kVideoMetadata,  // tags of a video's container
};

/// The focal length that the estimate of a lens without a calibration starts from.
struct FocalGuess {
  double focal_px = 0.0;
  FocalSource source = FocalSource::kImageSize;
  bool is_found = false;  // the images have told the lens

  /// Whether the camera itself has told it: right within 15 %.
  bool KnowsFocal() const { return source != FocalSource::kImageSize; }
};

/// `EXIF data`, `the video's metadata`; empty for kImageSize.
std::string Name(FocalSource source);

/// The focal length as if a film camera had taken the image, mm, from the EXIF data of a JPEG file;
/// nullopt where it does not say.
std::optional<double> FilmFocalLength(const std::filesystem::path& image);

/// The same from the tags of a video's container or its video stream (Sequence::metadata): keys
/// that name a focal length and 35 mm film, as in
/// `com.apple.quicktime.camera.focal_length.35mm_equivalent`, in any spelling; values such as `26`,
/// `26.5 mm` or `53/2`. nullopt where there is none between 5 and 2000 mm.
std::optional<double> FilmFocalLength(const std::map<std::string, std::string>& tags);

/// The focal length by the first image's EXIF data or the video's tags. Without these it is
/// GuessFocalLength.
/// @param path      that `sequence` was opened from.
FocalGuess GuessFocal(const std::filesystem::path& path,
                      const SequenceOptions& options,
                      const Sequence& sequence);

/// The warning to the user, and the entries of summary.json.
std::string WarningOf(const FocalGuess& guess, const Camera& refined);
SummaryTable SummaryOf(const FocalGuess& guess, const Camera& refined);

}  // namespace rotslam
