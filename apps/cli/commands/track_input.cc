#include "apps/cli/commands/track_input.h"

#include <array>
#include <cstdio>
#include <iterator>
#include <string>
#include <utility>

#include "apps/slam/focal_length.h"

namespace rotslam {

void RefineGuess(const RunOptions& options,
                 Interruption& interruption,
                 Progress& progress,
                 Input& input) {
  if (!input.guess) return;
  SlamProgress observer(options, interruption, progress);
  const EndAtInterruption end_at_interruption(interruption, [&] {
    progress.Warn("interrupted while the focal length is sought: nothing is written yet");
  });
  const FocalLengthEstimate estimate =
      FindFocalLength(*input.frames, input.camera, options, observer);
  input.camera = estimate.camera;
  input.readout = estimate.readout;
  input.guess->focal_px = estimate.camera.fx;
  std::array<char, 96> line = {};
  std::snprintf(line.data(),
                line.size(),
                "focal length: %.1f px; now the sequence from its start",
                estimate.camera.fx);
  progress.Say(estimate.is_found ? line.data()
                                 : "focal length: nothing tells it, the guess stands");
}

Orientations TrackInput(const RunOptions& options,
                        std::shared_ptr<const Vocabulary> vocabulary,
                        bool keep_features,
                        SlamProgress& observer,
                        Checkpoint& checkpoint,
                        Input& input) {
  OrientationInputs inputs;
  inputs.vocabulary = std::move(vocabulary);
  inputs.keep_features = keep_features;
  inputs.given = input.given_rotations;
  inputs.log = &checkpoint;
  Orientations orientations =
      FindOrientations(*input.frames, input.camera, options, inputs, observer);
  if (!orientations.IsUsable()) {
    throw InterruptedError("interrupted after frame " +
                           std::to_string(std::ssize(orientations.timestamps_s) - 1) +
                           ": too early, nothing is written");
  }
  input.camera = orientations.camera;
  if (orientations.readout) input.readout = orientations.readout;
  return orientations;
}

}  // namespace rotslam
