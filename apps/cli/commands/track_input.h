#pragma once

#include <chrono>
#include <filesystem>
#include <memory>
#include <string>

#include "apps/cli/input/input.h"
#include "apps/cli/input/run_options.h"
#include "apps/cli/run_directory/checkpoint.h"
#include "apps/cli/run_directory/unfinished.h"
#include "apps/cli/terminal/interruption.h"
#include "apps/cli/terminal/progress.h"
#include "apps/cli/terminal/slam_progress.h"
#include "apps/slam/orientations.h"

namespace rotslam {

/// The flags that `run` and `rotations` share.
struct TrackFlags {
  CommonFlags common;
  InputFlags input;
  CheckpointFlags checkpoint;
};

/// The stage that `run` and `rotations` share. It opens the input, estimates the focal length where
/// the camera is a guess, finds the orientations of all frames, and writes them to the folder of
/// unfinished outputs.
struct TrackedInput {
  /// @param keep_features  for a map.
  /// Throws what FindOrientations throws; InterruptedError where a request to stop came before
  /// there was anything to write.
  TrackedInput(const std::string& command,
               const TrackFlags& flags,
               RunOptions run_options,
               bool keep_features);

  const std::chrono::steady_clock::time_point start = std::chrono::steady_clock::now();
  Interruption interruption;
  Progress progress;
  RunOptions options;
  // Its camera holds the focal length and the readout that were estimated from the images.
  Input input;
  std::shared_ptr<const Vocabulary> vocabulary;
  std::filesystem::path directory;
  double guess_s = 0.0;  // until the focal length was found
  Checkpoint checkpoint;
  SlamProgress observer;
  Orientations orientations;
  UnfinishedOutputs outputs;
};

}  // namespace rotslam
