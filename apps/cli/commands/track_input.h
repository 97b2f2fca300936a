#pragma once

#include <chrono>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>

#include "apps/cli/input/input.h"
#include "apps/cli/input/run_options.h"
#include "apps/cli/run_directory/checkpoint.h"
#include "apps/cli/run_directory/unfinished.h"
#include "apps/cli/terminal/interruption.h"
#include "apps/cli/terminal/progress.h"
#include "apps/cli/terminal/slam_progress.h"
#include "apps/slam/map_result.h"
#include "apps/slam/orientations.h"
#include "apps/slam/working_size/working_size.h"

namespace rotslam {

/// The flags that `run` and `rotations` share.
struct TrackFlags {
  CommonFlags common;
  InputFlags input;
  CheckpointFlags checkpoint;
};

/// The stage that `run` and `rotations` share. It opens the input, estimates the focal length where
/// the camera is a guess, finds the orientations of all frames, and writes them to the folder of
/// unfinished outputs. Large images are reduced.
struct TrackedInput {
  /// Finds the orientations of an input that is otherwise ready, at the size that is worked with.
  using Tracking = std::function<Orientations(TrackedInput& input, const OrientationInputs&)>;

  /// @param keep_features  for a map.
  /// @param track          instead of FindOrientations.
  /// Throws what FindOrientations throws; InterruptedError where a request to stop came before
  /// there was anything to write.
  TrackedInput(const std::string& command,
               const TrackFlags& flags,
               RunOptions run_options,
               bool keep_features,
               const Tracking& track = nullptr);

  /// Results in pixels of the original images; call it once, when the map is built or none shall
  /// be.
  void ToOriginalSize();
  void ToOriginalSize(MapResult& map) const;

  const std::chrono::steady_clock::time_point start = std::chrono::steady_clock::now();
  Interruption interruption;
  Progress progress;
  RunOptions options;
  // Its camera, of the original images, holds the focal length and the readout that were estimated
  // from the images.
  Input input;
  WorkingSize working;
  ReducedFrames frames;  // of the input
  std::shared_ptr<const Vocabulary> vocabulary;
  std::filesystem::path directory;
  double lens_s = 0.0;  // until the lens was estimated
  Checkpoint checkpoint;
  SlamProgress observer;
  Orientations orientations;  // at the size that is worked with, until ToOriginalSize()
  UnfinishedOutputs outputs;
};

/// How the results of a run are written.
struct RunOutputFlags {
  bool ascii = false;  // PLY files as text
  bool use_report = true;
  const CommonFlags& common;
};

/// The second half of `run` and `live`, after the orientations: builds the map and writes the run
/// directory. Throws std::runtime_error where there is no map; orientations are written then.
/// @return  the program's exit code.
int FinishRun(TrackedInput& tracked, const RunOutputFlags& flags);

}  // namespace rotslam
