#pragma once

#include "ba/bundle_state.h"

namespace rotslam {

/// Decides which observations fit, the cameras standing where they stand, and which tracks make a
/// point or a direction; frames left with too few observations become weak.
/// @param round          its limit, and its loss, by which positions are compared.
/// @param retriangulate  look for each track's position anew; else it is judged where it is.
void ClassifyAll(const BundleRound& round,
                 bool retriangulate,
                 const BundleOptions& options,
                 BundleState& state);

/// Reprojection errors of the used observations of points.
ResidualStatistics Statistics(const BundleState& state);

}  // namespace rotslam
