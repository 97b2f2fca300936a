#include "apps/cli/input/lens_guess.h"

#include <array>
#include <cmath>
#include <cstdio>
#include <memory>

#include <libexif/exif-data.h>

#include "apps/cli/terminal/describe.h"
#include "apps/slam/lens_estimation.h"
#include "rotodom/sequence/sequence_form.h"

namespace rotslam {
namespace {

// Diagonal of a frame of 35 mm film, mm: CIPA DCG-001 defines the equivalent by it.
const double kFilmDiagonal = std::hypot(36.0, 24.0);

std::string Pixels(double focal_px) {
  std::array<char, 32> text = {};
  std::snprintf(text.data(), text.size(), "%.1f px", focal_px);
  return text.data();
}

}  // namespace

std::optional<double> FilmFocalLength(const std::filesystem::path& image) {
  const std::unique_ptr<ExifData, void (*)(ExifData*)> data(exif_data_new_from_file(image.c_str()),
                                                            exif_data_unref);
  if (!data) return std::nullopt;
  const ExifEntry* entry =
      exif_content_get_entry(data->ifd[EXIF_IFD_EXIF], EXIF_TAG_FOCAL_LENGTH_IN_35MM_FILM);
  if (entry == nullptr || entry->format != EXIF_FORMAT_SHORT || entry->size < 2) {
    return std::nullopt;
  }
  const int focal_mm = exif_get_short(entry->data, exif_data_get_byte_order(data.get()));
  // Zero says "not known".
  return focal_mm > 0 ? std::optional<double>(focal_mm) : std::nullopt;
}

FocalGuess GuessFocal(const std::filesystem::path& sequence,
                      const SequenceOptions& options,
                      const cv::Size& image_size) {
  FocalGuess guess;
  const Layout layout = FindLayout(sequence, options);
  const auto film_mm =
      layout.entries.empty() ? std::nullopt : FilmFocalLength(layout.entries.front().file);
  guess.is_from_exif = film_mm.has_value();
  guess.focal_px = film_mm
                       ? *film_mm / kFilmDiagonal * std::hypot(image_size.width, image_size.height)
                       : GuessFocalLength(image_size);
  return guess;
}

std::string WarningOf(const FocalGuess& guess, const Camera& refined) {
  if (guess.is_found) {
    return "no calibration: the lens is estimated from the images, " + DescribeRounded(refined) +
           "; camera.yaml has it. Sizes of angles may be off by some tenths of a percent";
  }
  return std::string("no calibration, and the images do not tell the lens: the focal length is ") +
         (guess.is_from_exif ? "from EXIF data, " : "a guess, 1.2 x the longer side, ") +
         Pixels(refined.fx) +
         ". Angles and shapes are off as far as that is. Turn and move the camera more, or give a "
         "calibration (rotslam calibrate)";
}

SummaryTable SummaryOf(const FocalGuess& guess, const Camera& refined) {
  return {{"source", guess.is_found ? "images" : "guess"},
          {"start", guess.is_from_exif ? "exif" : "image size"},
          {"start_px", guess.focal_px},
          {"refined_px", refined.MeanFocal()}};
}

}  // namespace rotslam
