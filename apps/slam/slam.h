#pragma once

#include <optional>

#include "apps/slam/build_map.h"
#include "apps/slam/focal_length.h"
#include "apps/slam/frame_source.h"
#include "apps/slam/observer.h"
#include "apps/slam/options.h"
#include "apps/slam/orientations.h"

namespace rotslam {

/// Inputs of the system beside frames and a camera.
struct SlamInputs : OrientationInputs {
  // The camera is a guess (UncalibratedCamera); its focal length is estimated first.
  bool find_focal_length = false;
};

/// Orientations of every frame, and the map.
struct SlamResult {
  std::optional<FocalLengthEstimate> focal_length;  // set: it was estimated
  Orientations orientations;
  MapResult map;  // empty where `orientations.interrupted`
};

/// Runs the whole system, from frames and a calibrated camera to orientations, positions and
/// points. Throws what FindOrientations throws. A sequence without a map is no error
/// (MapResult::failure).
SlamResult RunSlam(FrameSource& frames,
                   const Camera& camera,
                   const SlamOptions& options,
                   SlamObserver& observer,
                   const SlamInputs& inputs = {});

/// The same without an observer.
SlamResult RunSlam(FrameSource& frames, const Camera& camera, const SlamOptions& options = {});

}  // namespace rotslam
