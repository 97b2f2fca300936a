#include "apps/cli/input/focal_guess.h"

#include <array>
#include <cmath>
#include <cstdio>
#include <memory>

#include <libexif/exif-data.h>

#include "apps/slam/focal_length.h"
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
  if (film_mm) {
    guess.source = "focal_guess_exif";
    guess.guess_px = *film_mm / kFilmDiagonal * std::hypot(image_size.width, image_size.height);
  } else {
    guess.source = "focal_guess_width";
    guess.guess_px = GuessFocalLength(image_size);
  }
  guess.focal_px = guess.guess_px;
  return guess;
}

std::string WarningOf(const FocalGuess& guess, const Camera& refined) {
  const bool has_moved = refined.fx != guess.guess_px;
  return "no calibration: the focal length is " +
         std::string(guess.source == "focal_guess_exif" ? "from EXIF data, "
                                                        : "guessed as 1.2 x "
                                                          "the longer side, ") +
         Pixels(guess.guess_px) +
         (has_moved ? ", the images then made it " + Pixels(refined.fx)
                    : ", and nothing has corrected it") +
         "; a calibrated camera does better (rotslam calibrate)";
}

SummaryTable SummaryOf(const FocalGuess& guess, const Camera& refined) {
  return {{"source", guess.source},
          {"guess_px", guess.guess_px},
          {"first_pass_px", guess.focal_px},
          {"refined_px", refined.fx}};
}

}  // namespace rotslam
