#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include <opencv2/core.hpp>

#include "apps/cli/command.h"
#include "apps/cli/input/input.h"
#include "apps/cli/input/pipeline.h"
#include "apps/cli/terminal/interruption.h"
#include "apps/cli/terminal/progress.h"
#include "output/tables/summary.h"

namespace rotslam {

/// The focal length as if a film camera had taken the image, mm, from the EXIF data of a JPEG file;
/// nullopt where it does not say.
std::optional<double> FilmFocalLength(const std::filesystem::path& image);

/// A camera for images that nobody calibrated: no distortion, principal point in the middle. The
/// focal length is what the first image's EXIF data say, else 1.2 times the longer side, 45 deg of
/// view: between a phone (0.7 to 0.9) and a moderate zoom lens.
FocalGuess GuessFocal(const std::filesystem::path& sequence,
                      const SequenceOptions& options,
                      const cv::Size& image_size);
Camera CameraOf(const FocalGuess& guess, const cv::Size& image_size);

/// Lets bundle adjustment move the focal length as far as the images want.
void FreeFocal(LensOptions& lens);

/// Improves the guess of an input that has not been read from: solves the beginning of the sequence
/// for orientations and positions, with the focal length free, until that changes it little.
/// Orientations suffer from a wrong focal length (twice the right one loses KITTI 00 in its turn),
/// positions tell it all the same: 717 px from 1489, where the calibration says 719. So do turns in
/// place: 525.0 px from 768, where the truth is 525. Does nothing without a guess; leaves it where
/// neither can be found.
void RefineGuess(const InputFlags& flags,
                 const CommonFlags& common,
                 const PipelineOptions& options,
                 Interruption& interruption,
                 Progress& progress,
                 Input& input);

/// What to tell the user, and the part of summary.json.
std::string WarningOf(const FocalGuess& guess, const Camera& refined);
SummaryTable SummaryOf(const FocalGuess& guess, const Camera& refined);

}  // namespace rotslam
