#pragma once

#include "ba/bundle_state.h"

namespace rotslam {

/// Decides which observations fit, the cameras standing where they stand, and which tracks make a
/// point or a direction; frames left with too few observations become weak.
/// @param max_error_px   largest reprojection error of what fits; zero: whatever projects fits.
/// @param retriangulate  look for each track's position anew; else it is judged where it is.
void ClassifyAll(double max_error_px,
                 bool retriangulate,
                 const BundleOptions& options,
                 BundleState& state);

/// Reprojection errors of the used observations of points.
ResidualStatistics Statistics(const BundleState& state);

}  // namespace rotslam
