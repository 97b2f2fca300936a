#pragma once

#include <optional>
#include <vector>

#include "ba/bundle_adjustment.h"

namespace rotslam {

/// The result of a bundle adjustment of rotations alone.
struct PureRotationResult {
  BundleStatus status = BundleStatus::kNotRun;
  RotationMap cam_from_world;  // of every frame given; the first one stays
  Camera camera;               // with its lens refined, if that gains enough (LensOptions)
  bool lens_refined = false;   // whether it did
  std::optional<LensSigmas> lens_sigmas;  // of a refined lens, see BundleSummary
  std::optional<LensCovariance> lens_covariance;
  // Tracks, and observations of them, that one direction each explains.
  int num_directions = 0;
  int num_observations = 0;
  double final_cost = 0.0;  // half the sum of robust squared residuals, in sigmas

  [[nodiscard]] bool Usable() const {
    return status == BundleStatus::kConverged || status == BundleStatus::kIterationLimit;
  }
};

/// Bundle adjustment of a pure rotation: orientations, a direction for each track, and the lens
/// where `options.lens` lets any of it move. A rotation determines the focal length, which a path
/// does not: it may move as far as a calibration may be wrong, by some percent.
/// This does not decide whether the camera only rotates: a moving camera gets the best such
/// explanation, which leaves out most observations.
/// Source:  Hartley, Self-calibration of stationary cameras, IJCV 1997.
/// Throws std::invalid_argument as RefineBundle does.
PureRotationResult RefinePureRotation(const Camera& camera,
                                      const RotationMap& cam_from_world,
                                      const std::vector<Track>& tracks,
                                      const BundleOptions& options);

}  // namespace rotslam
