#pragma once

#include <optional>

#include "apps/slam/build_map.h"
#include "apps/slam/input/frame_source.h"
#include "apps/slam/lens_estimation.h"
#include "apps/slam/observer.h"
#include "apps/slam/options.h"
#include "apps/slam/orientations.h"
#include "apps/slam/working_size/working_size.h"

namespace rotslam {

/// Inputs of the system beside frames and a camera.
struct SlamInputs : OrientationInputs {
  // The camera is a guess (UncalibratedCamera); its lens is estimated first.
  bool estimate_lens = false;
  bool knows_focal = false;  // see LensGuess
};

/// Orientations of every frame, and the map.
struct SlamResult {
  std::optional<LensEstimate> lens;  // set: it was estimated
  Orientations orientations;
  MapResult map;  // empty where `orientations.interrupted`
};

/// Images that are reduced before features are detected.
struct ReducedInput {
  const WorkingSize& working;
  const Camera& camera;     // of the original images
  const FrameMasks& masks;  // as given, of the original images
  double level_scale;       // FeatureOptions::scale_factor
};

/// The masks of the original images: those given, with the static content found in reduced images.
FrameMasks OriginalMasks(const ReducedInput& input, const StaticContent& found);

/// Results of reduced images in pixels of the original ones: cameras, keypoints, masks and errors.
/// Where the images are not reduced nothing changes.
void ToOriginalSize(const ReducedInput& input, Orientations& orientations);
void ToOriginalSize(const ReducedInput& input, MapResult& map);

/// Runs the whole system, from frames and a calibrated camera to orientations, positions and
/// points. Throws what FindOrientations throws. A sequence without a map is no error
/// (MapResult::failure). Images larger than `options.max_image_side_px` are reduced; the result is
/// of the original ones, while the observer gets the reduced ones.
SlamResult RunSlam(FrameSource& frames,
                   const Camera& camera,
                   const SlamOptions& options,
                   SlamObserver& observer,
                   const SlamInputs& inputs = {});

/// The same without an observer.
SlamResult RunSlam(FrameSource& frames, const Camera& camera, const SlamOptions& options = {});

}  // namespace rotslam
