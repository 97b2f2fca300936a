#pragma once

#include <optional>

#include <ceres/solver.h>

#include "ba/problem/bundle_state.h"
#include "ba/types/bundle_options.h"
#include "ba/types/bundle_result.h"

namespace rotslam {

struct MinimisationResult {
  BundleRoundSummary counts;  // frames, points, directions and observations; no costs
  ceres::Solver::Summary solver;
};

/// Moves poses, points, directions and, where asked, the lens of `state` to a minimum of the used
/// observations' robust cost.
/// @param calibrated   the camera as it was given, to which priors hold the lens.
/// @param refine_lens  as far as `options.lens` lets it.
/// @return  nullopt, and the state as it was, when no frame that may move sees a point.
std::optional<MinimisationResult> Minimise(const Camera& calibrated,
                                           const BundleRound& round,
                                           bool refine_lens,
                                           const BundleOptions& options,
                                           BundleState& state);

}  // namespace rotslam
