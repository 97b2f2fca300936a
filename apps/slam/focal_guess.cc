#include "apps/slam/focal_guess.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <memory>

#include <libexif/exif-data.h>

#include "apps/slam/orientations.h"
#include "apps/slam/positions.h"
#include "apps/slam/readout_decision.h"
#include "rotodom/sequence/layout.h"

namespace rotslam {
namespace {

// Diagonal of a frame of 35 mm film, mm: CIPA DCG-001 defines the equivalent by it.
const double kFilmDiagonal = std::hypot(36.0, 24.0);

// Frames the first pass looks at: enough movement for a focal length, in bounded time.
constexpr int kFirstPassFrames = 600;

// Orientations that a wrong focal length has bent hold on to it: from half as much again the images
// say 12 % too much, and from there the truth. So passes go on until one changes less than this
// share.
constexpr double kFirstPassTolerance = 0.05;
constexpr int kMaxFirstPasses = 4;

std::string Pixels(double focal_px) {
  std::array<char, 32> text = {};
  std::snprintf(text.data(), text.size(), "%.1f px", focal_px);
  return text.data();
}

// What the first pass leaves out: it wants the focal length alone.
PipelineOptions FirstPass(PipelineOptions options) {
  options.loop.use_loops = false;
  options.krot.use_bracket = options.krot.start == "bisection";
  options.ba.find_covariance = false;
  FreeFocal(options.ba.lens);
  const std::int64_t last =
      options.sequence.first + (kFirstPassFrames - 1) * std::int64_t{options.sequence.stride};
  const int end =
      options.sequence.last < 0 ? std::numeric_limits<int>::max() : options.sequence.last;
  options.sequence.last = static_cast<int>(std::min<std::int64_t>(last, end));
  return options;
}

// The focal length that the beginning of the sequence tells, from that of `input`'s camera, which
// also gets the readout, if it tells one.
// @return  nullopt where it tells none.
std::optional<double> FocalFrom(const InputFlags& flags,
                                const CommonFlags& common,
                                const PipelineOptions& options,
                                Input& input,
                                Interruption& interruption,
                                Progress& progress) {
  Input part;
  part.path = input.path;
  part.sequence = OpenSequence(flags.sequence, options.sequence);
  part.camera = input.camera;
  const Orientations orientations =
      FindOrientations(part, options, nullptr, true, common, interruption, progress);
  if (part.readout) SetReadout(*part.readout, input);
  const char* const end = "interrupted while the focal length is sought: nothing is written yet";
  if (orientations.interrupted) throw InterruptedError(end);
  const LastWords last_words(interruption, [&] { progress.Warn(end); });
  const PositionResult positions =
      FindKeyframePositions(orientations, part.camera, options, common.NumThreads(), progress);
  if (positions.camera.fx == part.camera.fx) return std::nullopt;
  return positions.camera.fx;
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
    guess.guess_px = 1.2 * std::max(image_size.width, image_size.height);
  }
  guess.focal_px = guess.guess_px;
  return guess;
}

Camera CameraOf(const FocalGuess& guess, const cv::Size& image_size) {
  Camera camera;
  camera.width = image_size.width;
  camera.height = image_size.height;
  camera.fx = camera.fy = guess.focal_px;
  camera.cx = 0.5 * (image_size.width - 1);
  camera.cy = 0.5 * (image_size.height - 1);
  return camera;
}

void FreeFocal(LensOptions& lens) {
  lens.refine_focal = true;
  // A share: a guess says next to nothing.
  lens.focal_sigma = 1.0;
}

void RefineGuess(const InputFlags& flags,
                 const CommonFlags& common,
                 const PipelineOptions& options,
                 Interruption& interruption,
                 Progress& progress,
                 Input& input) {
  if (!input.guess) return;
  FocalGuess& guess = *input.guess;
  for (int pass = 1; pass <= kMaxFirstPasses; ++pass) {
    const double before_px = guess.focal_px;
    progress.Say("pass " + std::to_string(pass) +
                 " over the beginning, for the focal length: from " + Pixels(before_px) +
                 (pass == 1 ? ", a guess" : ""));
    const std::optional<double> focal_px =
        FocalFrom(flags, common, FirstPass(options), input, interruption, progress);
    if (focal_px) {
      guess.focal_px = *focal_px;
      input.camera = CameraOf(guess, input.sequence->image_size());
      if (input.readout) SetReadout(*input.readout, input);
    }
    if (std::abs(guess.focal_px - before_px) <= kFirstPassTolerance * before_px) break;
  }
  progress.Say(guess.focal_px != guess.guess_px
                   ? "focal length: " + Pixels(guess.focal_px) + "; now the sequence from its start"
                   : std::string("focal length: nothing tells it, the guess stands"));
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
