#pragma once

#include <optional>
#include <string>

#include "apps/cli/command.h"
#include "apps/cli/input/input.h"
#include "apps/slam/relocalisation.h"
#include "ba/bundle_adjustment.h"
#include "ba/resection.h"
#include "krot/known_rotation.h"
#include "krot/pure_rotation_segments.h"
#include "output/map/cloud_outliers.h"
#include "rotodom/loop/loop_closure.h"
#include "rotodom/odometry.h"
#include "rotodom/sequence/sequence.h"
#include "rotodom/track_completion/track_completion.h"
#include "rotodom/tracks/keyframes.h"

namespace rotslam {

/// Of cameras whose file does not say how the sensor is read out.
struct ReadoutOptions {
  // Off: they have a global shutter.
  bool enabled = true;
  // Nobody asks after so many frames. More would find shutters of cameras that stand for the first
  // half minute, and have to read it again.
  int max_frames = 1000;

  std::optional<std::string> Problem() const;

  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("enabled", enabled);
    visit("max_frames", max_frames);
  }
};

/// All that `rotslam run` can be told, stage by stage. The defaults run a real sequence untouched.
struct PipelineOptions {
  SequenceOptions sequence;
  OdometryOptions rotodom;
  ReadoutOptions readout;
  LoopOptions loop;
  PureRotationOptions pure_rotation_segments;
  KeyframeOptions keyframes;
  KrotOptions krot;
  BundleOptions ba;
  CompletionOptions completion;
  RelocalisationOptions relocalisation;
  ResectionOptions resection;
  // Points whose rays meet at less than this stay out of the cloud: their depth is noise.
  double cloud_min_angle_deg = 2.0;
  CloudOutlierOptions cloud_outliers;

  std::optional<std::string> Problem() const;

  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("sequence", sequence);
    visit("rotodom", rotodom);
    visit("readout", readout);
    visit("loop", loop);
    visit("pure_rotation_segments", pure_rotation_segments);
    visit("keyframes", keyframes);
    visit("krot", krot);
    visit("ba", ba);
    visit("completion", completion);
    visit("relocalisation", relocalisation);
    visit("resection", resection);
    visit("cloud_min_angle_deg", cloud_min_angle_deg);
    visit("cloud_outliers", cloud_outliers);
  }
};

/// What `run` and `solve` take about the known-rotation solver.
struct KrotFlags {
  std::string start;  // empty: as the configuration says
  bool no_certificate = false;

  void Override(KrotOptions& options) const;
};

void AddKrotFlags(CLI::App& command, KrotFlags& flags);

/// The defaults, overridden by the configuration file and then by the flags.
PipelineOptions ReadPipelineOptions(const CommonFlags& common, const InputFlags& input);

}  // namespace rotslam
