#pragma once

#include <optional>

#include "apps/slam/build_map.h"
#include "apps/slam/focal_length.h"
#include "apps/slam/frame_source.h"
#include "apps/slam/observer.h"
#include "apps/slam/options.h"
#include "apps/slam/orientations.h"

namespace rotslam {

/// What the system takes beside frames and a camera.
struct SlamInputs : OrientationInputs {
  // The camera is a guess (UncalibratedCamera): its focal length is found first.
  bool find_focal_length = false;
};

/// Orientations of every frame, and the map.
struct SlamResult {
  std::optional<FocalLengthEstimate> focal_length;  // set: it was sought
  Orientations orientations;
  MapResult map;  // has nothing where `orientations.interrupted`
};

/// The whole system: from frames and a calibrated camera to orientations, positions and points.
/// Throws what FindOrientations throws. That there is no map is no error: see MapResult::failure.
SlamResult RunSlam(FrameSource& frames,
                   const Camera& camera,
                   const SlamOptions& options,
                   SlamObserver& observer,
                   const SlamInputs& inputs = {});

/// The same with nobody watching.
SlamResult RunSlam(FrameSource& frames, const Camera& camera, const SlamOptions& options = {});

}  // namespace rotslam
