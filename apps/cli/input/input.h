#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "apps/cli/input/lens_guess.h"
#include "apps/cli/terminal/common_flags.h"
#include "apps/slam/input/frame_source.h"
#include "apps/slam/input/given_rotations.h"
#include "apps/slam/masks/frame_masks.h"
#include "rotodom/camera/camera.h"
#include "rotodom/camera/lens_sigmas.h"
#include "rotodom/loop/loop_closure.h"
#include "rotodom/masks/static_content.h"
#include "rotodom/rolling_shutter/readout.h"
#include "rotodom/sequence/sequence.h"

namespace rotslam {

/// The input flags of `run` and `rotations`.
struct InputFlags {
  std::string sequence;
  std::string camera;        // `none`: the lens is estimated, whatever lies with the images
  bool focal_guess = false;  // the same as `none`
  std::string out;
  // Set: override the configuration.
  std::optional<int> first;
  std::optional<int> last;
  std::optional<int> stride;
  std::optional<double> fps;
  std::optional<bool> loops;
  std::string rotations;   // orientations from elsewhere; empty: from the images alone
  bool align = false;      // take out their offset in time and their mounting
  std::string vocabulary;  // empty: the one that comes with the program
  std::string mask;        // an image, of all frames; empty: none
  std::string masks;       // a folder, one image a frame; empty: none
  bool auto_mask = true;   // look for static content on the picture

  void Override(SequenceOptions& options) const;
  void Override(LoopOptions& options) const;
};

void AddInputFlags(CLI::App& command, InputFlags& flags);

/// A sequence with its camera, opened for a run.
struct Input {
  std::string path;  // of the sequence, absolute
  std::unique_ptr<SequenceSource> frames;
  Camera camera;                          // with the size of the images
  std::optional<LensSigmas> lens_sigmas;  // of the camera; nullopt: its file does not say
  std::string camera_file;
  std::string camera_source;              // for people: the file, the camera in it, its form
  std::vector<std::string> camera_notes;  // what its reader ignored or assumed
  std::optional<FocalGuess> guess;        // set: there is no calibration
  // How its sensor is read out, where the images tell it instead of the calibration.
  std::optional<ReadoutEstimate> readout;
  std::optional<OrientationsFromElsewhere> given_rotations;
  FrameMasks masks;
  bool find_static_content = true;
  StaticContent static_content;  // found in a first pass, at the size that is worked with

  const Sequence& sequence() const { return frames->sequence(); }
};

}  // namespace rotslam
