#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "ba/problem/bundle_state.h"
#include "ba/types/bundle_options.h"
#include "ba/types/bundle_result.h"
#include "rotodom/camera/camera.h"
#include "rotodom/camera/lens_parameters.h"

namespace rotslam {

/// Covariances of poses and lens at a minimum, as BundleResult has them.
struct CameraCovariances {
  std::vector<std::optional<PoseCovariance>> poses;  // by frame of the state; nullopt: not in it
  std::optional<LensCovariance> lens;                // zero for blocks that are held
};

/// Covariances of the cameras at the minimum that `state` is; the arguments are Minimise's.
/// @return  nullopt when the observations do not determine a camera.
std::optional<CameraCovariances> FindCovariances(const Camera& calibrated,
                                                 const BundleRound& round,
                                                 bool refine_lens,
                                                 const BundleOptions& options,
                                                 BundleState& state);

}  // namespace rotslam
