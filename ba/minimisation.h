#pragma once

#include <optional>
#include <vector>

#include <ceres/solver.h>

#include "ba/bundle_state.h"

namespace rotslam {

struct MinimisationResult {
  BundleRoundSummary counts;  // frames, points, directions and observations; no costs
  ceres::Solver::Summary solver;
};

/// Moves poses, points, directions and, where asked, the lens of `state` to a minimum of the used
/// observations' robust cost.
/// @param calibrated   the camera as it was given: what the lens is held to.
/// @param refine_lens  as far as `options.lens` lets it.
/// @return  nullopt, and the state as it was, when no frame that may move sees a point.
std::optional<MinimisationResult> Minimise(const Camera& calibrated,
                                           const BundleRound& round,
                                           bool refine_lens,
                                           const BundleOptions& options,
                                           BundleState& state);

/// How well a minimum is known where nothing outside the state is: see BundleResult.
struct CameraCovariances {
  std::vector<std::optional<PoseCovariance>> poses;  // by frame of the state; nullopt: not in it
  std::optional<Eigen::Matrix<double, 6, 6>> lens;   // of LensParameters
};

/// Covariances of the cameras at the minimum that `state` is; the arguments are Minimise's.
/// @return  nullopt when the observations leave a camera open.
std::optional<CameraCovariances> FindCovariances(const Camera& calibrated,
                                                 const BundleRound& round,
                                                 bool refine_lens,
                                                 const BundleOptions& options,
                                                 BundleState& state);

}  // namespace rotslam
