#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "apps/slam/map/cloud_outliers.h"
#include "apps/slam/map_correction/relocalisation_options.h"
#include "ba/bundle_adjustment.h"
#include "ba/resection.h"
#include "krot/known_rotation.h"
#include "krot/pure_rotation_segments.h"
#include "rotodom/loop/loop_closure.h"
#include "rotodom/odometry.h"
#include "rotodom/track_completion/track_completion.h"
#include "rotodom/tracks/keyframes.h"

namespace rotslam {

/// How the readout of a sensor is found whose calibration does not say it.
struct ReadoutOptions {
  // Off: cameras that do not say have a global shutter.
  bool enabled = true;
  // After so many frames the search ends. A later answer would cost another reading of a long
  // beginning in which the camera hardly turned.
  int max_frames = 1000;

  std::optional<std::string> Problem() const;

  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("enabled", enabled);
    visit("max_frames", max_frames);
  }
};

/// Options of the whole system, stage by stage. The defaults suit real sequences.
struct SlamOptions {
  // Images whose longer side is larger are reduced to at most this before features are detected
  // (WorkingSize): less keeps fewer details and takes less time.
  int max_image_side_px = 1600;
  OdometryOptions rotodom;
  ReadoutOptions readout;
  LoopOptions loop;
  PureRotationOptions pure_rotation_segments;
  KeyframeOptions keyframes;
  KrotOptions krot;
  BundleOptions ba;
  CompletionOptions track_completion;
  RelocalisationOptions relocalisation;
  ResectionOptions resection;
  // Points whose rays meet at less than this stay out of the cloud: their depth is noise.
  double cloud_min_angle_deg = 2.0;
  CloudOutlierOptions cloud_outliers;

  // Of the run, not of the method; configuration files do not have them.
  std::uint64_t seed = 1;  // equal seeds give equal bytes
  int num_threads = 1;     // results do not depend on it

  std::optional<std::string> Problem() const;

  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("max_image_side_px", max_image_side_px);
    visit("rotodom", rotodom);
    visit("readout", readout);
    visit("loop", loop);
    visit("pure_rotation_segments", pure_rotation_segments);
    visit("keyframes", keyframes);
    visit("krot", krot);
    visit("ba", ba);
    visit("track_completion", track_completion);
    visit("relocalisation", relocalisation);
    visit("resection", resection);
    visit("cloud_min_angle_deg", cloud_min_angle_deg);
    visit("cloud_outliers", cloud_outliers);
  }
};

}  // namespace rotslam
