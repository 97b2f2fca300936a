#pragma once

#include <optional>

#include <ceres/solver.h>

#include "ba/bundle_state.h"

namespace rotslam {

struct MinimisationResult {
  BundleRoundSummary counts;  // frames, points, directions and observations; no costs
  ceres::Solver::Summary solver;
};

/// Moves poses, points and directions of `state` to a minimum of the used observations' robust
/// cost.
/// @return  nullopt, and the state as it was, when no frame that may move sees a point.
std::optional<MinimisationResult> Minimise(const Camera& camera,
                                           const BundleRound& round,
                                           const BundleOptions& options,
                                           BundleState& state);

}  // namespace rotslam
