#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "apps/cli/command.h"
#include "apps/cli/commands/checkerboard.h"
#include "apps/cli/input/config.h"
#include "apps/cli/input/lens_guess.h"
#include "apps/cli/input/run_options.h"
#include "apps/cli/terminal/interruption.h"
#include "apps/cli/terminal/progress.h"
#include "apps/cli/terminal/slam_progress.h"
#include "apps/slam/lens_estimation.h"
#include "apps/slam/working_size/original_size.h"
#include "output/files/atomic_file.h"
#include "rotodom/camera/read_camera.h"
#include "rotodom/sequence/sequence.h"
#include "rotodom/types/parallel.h"

namespace rotslam {
namespace {

struct CalibrateFlags {
  CommonFlags common;
  std::string images;
  std::string checkerboard;
  double square_m = Checkerboard{}.square_m;
  std::string out;
  int stride = 0;
};

// What people are told about.
constexpr double kNotableFocalSigma = 0.005;
constexpr double kNotableErrorPx = 1.0;
constexpr double kEnoughCovered = 0.5;
// Of a video neighbouring frames show the same board; about so many are looked at.
constexpr int kFramesOfVideo = 150;

Checkerboard BoardOf(const CalibrateFlags& flags) {
  Checkerboard board;
  char end = 0;
  const int read =
      std::sscanf(flags.checkerboard.c_str(), "%dx%d%c", &board.columns, &board.rows, &end);
  if (read != 2 || std::min(board.columns, board.rows) < 3 ||
      std::max(board.columns, board.rows) > 100) {
    throw std::runtime_error(
        "--checkerboard takes inner corners as COLUMNSxROWS (9x6), at least "
        "3x3, not " +
        flags.checkerboard);
  }
  board.square_m = flags.square_m;
  return board;
}

std::unique_ptr<Sequence> OpenImages(const CalibrateFlags& flags) {
  SequenceOptions options;
  options.stride = std::max(1, flags.stride);
  auto sequence = OpenSequence(flags.images, options);
  if (flags.stride == 0 && sequence->is_video()) {
    options.stride = std::max(1, sequence->NumFrames() / kFramesOfVideo);
    if (options.stride > 1) sequence = OpenSequence(flags.images, options);
  }
  return sequence;
}

struct FoundBoards {
  std::vector<BoardCorners> boards;
  int num_images = 0;
};

// Reads on while boards are looked for, a handful of images at a time.
FoundBoards FindBoards(Sequence& sequence,
                       const Checkerboard& board,
                       int num_threads,
                       Progress& progress) {
  const std::size_t batch_size = 2 * static_cast<std::size_t>(num_threads);
  FoundBoards found;
  progress.StartStage("boards", sequence.NumFrames());
  for (bool is_over = false; !is_over;) {
    std::vector<Frame> batch;
    batch.reserve(batch_size);
    while (!is_over && batch.size() < batch_size) {
      std::optional<Frame> frame = sequence.Next();
      is_over = !frame;
      if (!frame) continue;
      if (frame->image.empty()) progress.Warn(frame->name + " skipped: " + frame->problem);
      batch.push_back(std::move(*frame));
    }
    std::vector<std::optional<BoardCorners>> corners(batch.size());
    ParallelFor(static_cast<int>(batch.size()), num_threads, [&](int k) {
      if (!batch[k].image.empty()) corners[k] = FindBoard(batch[k].image, board);
    });
    for (std::size_t k = 0; k < batch.size(); ++k) {
      progress.Detail(batch[k].name + (corners[k] ? ": board" : ": no board"));
      if (corners[k]) found.boards.push_back(std::move(*corners[k]));
    }
    found.num_images += static_cast<int>(batch.size());
    progress.Step(found.num_images, {std::to_string(found.boards.size()) + " boards"});
  }
  progress.EndStage(std::to_string(found.boards.size()) + " in " +
                    std::to_string(found.num_images) + " images");
  return found;
}

std::string DescribeFit(const BoardCalibration& calibration, const FoundBoards& found) {
  std::array<char, 200> text = {};
  std::snprintf(text.data(),
                text.size(),
                "%d of %d images used, reprojection error %.3f px (root mean square), focal length "
                "+-%.2f %%, %.0f %% of the image covered",
                calibration.num_boards,
                found.num_images,
                calibration.error_px,
                100.0 * calibration.focal_sigma,
                100.0 * calibration.covered_share);
  return text.data();
}

void WarnOfWeakness(const BoardCalibration& calibration, Progress& progress) {
  const auto percent = [](double share) {
    return std::to_string(static_cast<int>(std::lround(100.0 * share))) + " %";
  };
  if (calibration.covered_share < kEnoughCovered) {
    progress.Warn("the boards cover only " + percent(calibration.covered_share) +
                  " of the image; the lens' distortion outside is a guess: take some with the "
                  "board at the edges and in the corners");
  }
  if (calibration.focal_sigma > kNotableFocalSigma) {
    progress.Warn("the focal length is known only to " +
                  std::to_string(100.0 * calibration.focal_sigma) +
                  " %: take some with the board tilted by 30 to 45 deg, and nearer");
  }
  if (calibration.error_px > kNotableErrorPx) {
    progress.Warn(
        "corners are off by more than a pixel: is the board flat, are the images sharp, "
        "does the camera keep its zoom and focus?");
  }
}

// A camera file from any film: EstimateLens.
int CalibrateWithoutBoard(const CalibrateFlags& flags) {
  Progress progress(flags.common);
  SequenceOptions sequence_options;
  sequence_options.stride = std::max(1, flags.stride);
  SequenceSource original(flags.images, sequence_options);
  const cv::Size size = original.sequence().image_size();
  progress.Say("input:  " + original.sequence().Describe());
  RunOptions options;
  options.seed = flags.common.seed;
  options.num_threads = flags.common.NumThreads();
  const FocalGuess guess = GuessFocal(flags.images, sequence_options, original.sequence());
  const WorkingSize working(size, options.max_image_side_px);
  ReducedFrames frames(original, working);
  const Interruption interruption;
  SlamProgress observer(options, working, interruption, progress);
  const LensEstimate estimate =
      EstimateLens(frames,
                   {working.Reduced(UncalibratedCamera(size, guess.focal_px)), guess.KnowsFocal()},
                   options,
                   observer);
  if (estimate.interrupted) return Interruption::kExitCode;
  if (!estimate.is_found) {
    throw std::runtime_error(flags.images +
                             ": the images do not tell the lens: film with turns, from several "
                             "places, things near and far; or film a printed checkerboard "
                             "(--checkerboard)");
  }
  const Camera camera = working.Original(estimate.camera);
  LensSigmas sigmas = estimate.sigmas;
  ToOriginalSize(working, sigmas);
  ReplaceFile(flags.out, "# Estimated from " + flags.images + ".\n" + CameraYaml(camera, sigmas));
  progress.Say("camera: " + Describe(camera));
  progress.Say("wrote " + flags.out);
  return 0;
}

int Calibrate(const CalibrateFlags& flags) {
  if (flags.checkerboard.empty()) return CalibrateWithoutBoard(flags);
  const Checkerboard board = BoardOf(flags);
  Progress progress(flags.common);
  BoardCalibrationOptions options;
  if (!flags.common.config.empty()) LoadOptionsYaml(flags.common.config, options);
  const auto sequence = OpenImages(flags);
  progress.Say("input:  " + sequence->Describe());
  const FoundBoards found = FindBoards(*sequence, board, flags.common.NumThreads(), progress);
  const auto calibration =
      CalibrateWithBoards(found.boards, board, sequence->image_size(), options);
  if (!calibration) {
    throw std::runtime_error(
        flags.images + ": a " + flags.checkerboard + " checkerboard is seen whole in only " +
        std::to_string(found.boards.size()) + " of " + std::to_string(found.num_images) +
        " images, at least " + std::to_string(options.min_boards) +
        " are needed: count the inner corners, where four squares meet, and leave a white margin");
  }
  const std::string fit = DescribeFit(*calibration, found);
  ReplaceFile(flags.out,
              "# " + flags.checkerboard + " checkerboard: " + fit + ".\n" +
                  CameraYaml(calibration->camera));
  progress.Say("camera: " + Describe(calibration->camera));
  progress.Say(fit);
  WarnOfWeakness(*calibration, progress);
  progress.Say("wrote " + flags.out);
  return 0;
}

}  // namespace

void AddCalibrateCommand(CLI::App& app, Action& action) {
  const auto flags = std::make_shared<CalibrateFlags>();
  CLI::App* command = app.add_subcommand(
      "calibrate", "A camera file from images of a printed checkerboard, or from any film");
  command
      ->add_option(
          "images",
          flags->images,
          "Images or video: of the board, whole, from many sides, up to the corners; or of "
          "any place")
      ->required();
  command->add_option(
      "--checkerboard",
      flags->checkerboard,
      "Inner corners, where four squares meet, as COLUMNSxROWS; without it the lens is "
      "estimated from any film in which the camera turns and moves");
  command
      ->add_option("--square",
                   flags->square_m,
                   "Edge of a square in metres; the camera file does not depend on it")
      ->check(AboveZero())
      ->capture_default_str();
  command->add_option("--out", flags->out, "Camera file to write, YAML")->required();
  command
      ->add_option(
          "--stride", flags->stride, "Look at every n-th image; 0: all, about 150 of a video")
      ->check(AtLeastZero());
  AddCommonFlags(*command, flags->common);
  command->footer(
      "Example: rotslam calibrate board.mp4 --checkerboard 9x6 --square 0.025 --out phone.yaml");
  command->callback([flags, &action] { action = [flags] { return Calibrate(*flags); }; });
}

}  // namespace rotslam
