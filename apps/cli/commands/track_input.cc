#include "apps/cli/commands/track_input.h"

#include <array>
#include <cstdio>
#include <iterator>
#include <utility>

#include "apps/cli/input/open_input.h"
#include "apps/cli/run_directory/orientation_files.h"
#include "apps/cli/run_directory/run_directory.h"
#include "apps/slam/focal_length.h"
#include "rotodom/types/stopwatch.h"

namespace rotslam {
namespace {

// Finds the focal length of an input whose camera is a guess; of another one nothing. A request to
// stop ends the program meanwhile: nothing is lost yet.
// @return  seconds since the start.
double RefineGuess(TrackedInput& tracked) {
  Input& input = tracked.input;
  if (!input.guess) return SecondsSince(tracked.start);
  SlamProgress observer(tracked.options, tracked.interruption, tracked.progress);
  const EndAtInterruption end_at_interruption(tracked.interruption, [&] {
    tracked.progress.Warn("interrupted while the focal length is sought: nothing is written yet");
  });
  const FocalLengthEstimate estimate =
      FindFocalLength(*input.frames, input.camera, tracked.options, observer);
  input.camera = estimate.camera;
  input.readout = estimate.readout;
  input.guess->focal_px = estimate.camera.fx;
  std::array<char, 96> line = {};
  std::snprintf(line.data(),
                line.size(),
                "focal length: %.1f px; now the sequence from its start",
                estimate.camera.fx);
  tracked.progress.Say(estimate.is_found ? line.data()
                                         : "focal length: nothing tells it, the guess stands");
  return SecondsSince(tracked.start);
}

Orientations TrackFrames(TrackedInput& tracked, bool keep_features) {
  Input& input = tracked.input;
  Orientations orientations = FindOrientations(
      *input.frames,
      input.camera,
      tracked.options,
      {tracked.vocabulary, keep_features, input.given_rotations, &tracked.checkpoint},
      tracked.observer);
  if (!orientations.IsUsable()) {
    throw InterruptedError("interrupted after frame " +
                           std::to_string(std::ssize(orientations.timestamps_s) - 1) +
                           ": too early, nothing is written");
  }
  input.camera = orientations.camera;
  if (orientations.readout) input.readout = orientations.readout;
  return orientations;
}

}  // namespace

TrackedInput::TrackedInput(const std::string& command,
                           const TrackFlags& flags,
                           RunOptions run_options,
                           bool keep_features)
    : progress(flags.common),
      options(std::move(run_options)),
      input(OpenInput(
          flags.input, options.sequence, [this](const std::string& line) { progress.Say(line); })),
      vocabulary(OpenVocabulary(flags.input)),
      directory(PrepareRunDirectory(flags.input.out)),
      guess_s(RefineGuess(*this)),
      checkpoint(directory,
                 flags.checkpoint,
                 IdentityOf(command, input, flags.input, options, flags.common.seed),
                 progress),
      observer(options, interruption, progress),
      orientations(TrackFrames(*this, keep_features)),
      outputs(directory) {
  WriteOrientations(outputs.folder(), orientations);
}

}  // namespace rotslam
