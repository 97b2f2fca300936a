#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "apps/cli/input/focal_guess.h"
#include "apps/cli/terminal/common_flags.h"
#include "apps/slam/frame_source.h"
#include "apps/slam/given_rotations.h"
#include "rotodom/camera/camera.h"
#include "rotodom/loop/loop_closure.h"
#include "rotodom/rolling_shutter/readout.h"
#include "rotodom/sequence/sequence.h"

namespace rotslam {

/// What `run` and `rotations` take.
struct InputFlags {
  std::string sequence;
  std::string camera;
  bool focal_guess = false;  // do without a calibration
  std::string out;
  // Set: override the configuration.
  std::optional<int> first;
  std::optional<int> last;
  std::optional<int> stride;
  std::optional<double> fps;
  std::optional<bool> loops;
  std::string rotations;   // orientations from elsewhere; empty: from the images
  std::string vocabulary;  // empty: the one that comes with the program

  void Override(SequenceOptions& options) const;
  void Override(LoopOptions& options) const;
};

void AddInputFlags(CLI::App& command, InputFlags& flags);

/// A sequence with its camera, opened for a run.
struct Input {
  std::string path;  // of the sequence, absolute
  std::unique_ptr<SequenceSource> frames;
  Camera camera;  // with the size of the images
  std::string camera_file;
  std::string camera_source;              // for people: the file, the camera in it, its form
  std::vector<std::string> camera_notes;  // what its reader ignored or assumed
  std::optional<FocalGuess> guess;        // set: there is no camera_file
  // How its sensor is read out, where the images tell it instead of the calibration.
  std::optional<ReadoutEstimate> readout;
  std::optional<OrientationsFromElsewhere> given_rotations;

  const Sequence& sequence() const { return frames->sequence(); }
};

}  // namespace rotslam
