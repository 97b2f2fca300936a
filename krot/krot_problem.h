#pragma once

#include <vector>

#include "krot/krot_options.h"
#include "rotodom/types/maps.h"
#include "rotodom/types/track.h"

namespace rotslam {

/// The input that all steps of the known-rotation solver read. It owns nothing.
struct KrotProblem {
  const RotationMap& cam_from_world;
  const std::vector<Track>& tracks;  // clean: finite unit bearings, frames ascending (CleanTracks)
  const KrotOptions& options;
  const KrotUnits& units;
};

}  // namespace rotslam
