#include "apps/cli/input/lens_guess.h"

#include <array>
#include <cctype>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>

#include <libexif/exif-data.h>

#include "apps/cli/terminal/describe.h"
#include "apps/slam/lens_estimation.h"
#include "rotodom/sequence/sequence_form.h"

namespace rotslam {
namespace {

// Diagonal of a frame of 35 mm film, mm: CIPA DCG-001 defines the equivalent by it.
const double kFilmDiagonal = std::hypot(36.0, 24.0);

// Focal lengths of lenses that exist, as if for film; anything else is a mistake.
constexpr double kLeastFilm_mm = 5.0;
constexpr double kMostFilm_mm = 2000.0;

// Letters and digits, in lower case.
std::string LettersOf(const std::string& key) {
  std::string letters;
  for (const char c : key) {
    const auto byte = static_cast<unsigned char>(c);
    if (std::isalnum(byte) != 0) letters += static_cast<char>(std::tolower(byte));
  }
  return letters;
}

// `26`, `26.5 mm`, `53/2`; not finite, or 0, where there is no number.
double NumberAtStart(const std::string& text) {
  char* end = nullptr;
  const double number = std::strtod(text.c_str(), &end);
  return *end == '/' ? number / std::strtod(end + 1, nullptr) : number;
}

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

std::optional<double> FilmFocalLength(const std::map<std::string, std::string>& tags) {
  for (const auto& [key, value] : tags) {
    const std::string letters = LettersOf(key);
    // EXIF's own name of it is FocalLengthIn35mmFilm, in short FocalLenIn35mmFilm.
    if (letters.find("focallen") == std::string::npos ||
        letters.find("35mm") == std::string::npos) {
      continue;
    }
    const double focal_mm = NumberAtStart(value);
    if (focal_mm >= kLeastFilm_mm && focal_mm <= kMostFilm_mm) return focal_mm;
  }
  return std::nullopt;
}

std::string Name(FocalSource source) {
  switch (source) {
    case FocalSource::kExif:
      return "EXIF data";
    case FocalSource::kVideoMetadata:
      return "the video's metadata";
    case FocalSource::kImageSize:
      break;
  }
  return {};
}

FocalGuess GuessFocal(const std::filesystem::path& path,
                      const SequenceOptions& options,
                      const Sequence& sequence) {
  FocalGuess guess;
  const cv::Size image_size = sequence.image_size();
  const Layout layout = FindLayout(path, options);
  const auto film_mm = layout.entries.empty() ? FilmFocalLength(sequence.metadata())
                                              : FilmFocalLength(layout.entries.front().file);
  if (film_mm) {
    guess.source = layout.entries.empty() ? FocalSource::kVideoMetadata : FocalSource::kExif;
  }
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
         (guess.KnowsFocal() ? "from " + Name(guess.source) + ", "
                             : "a guess, 1.2 x the longer side, ") +
         Pixels(refined.fx) +
         ". Angles and shapes are off as far as that is. Turn and move the camera more, or give a "
         "calibration (rotslam calibrate)";
}

SummaryTable SummaryOf(const FocalGuess& guess, const Camera& refined) {
  const auto start = [&]() -> std::string {
    if (guess.source == FocalSource::kExif) return "exif";
    return guess.KnowsFocal() ? "video metadata" : "image size";
  };
  return {{"source", guess.is_found ? "images" : "guess"},
          {"start", start()},
          {"start_px", guess.focal_px},
          {"refined_px", refined.MeanFocal()}};
}

}  // namespace rotslam
