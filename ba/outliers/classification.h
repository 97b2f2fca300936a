#pragma once

#include "ba/problem/bundle_state.h"
#include "ba/types/bundle_options.h"
#include "ba/types/bundle_result.h"

namespace rotslam {

/// The method by which classification finds a track's position.
enum class Placement {
  // From all observations and from pairs of them: the result depends on the poses alone, not on
  // the position before.
  kAnywhere,
  kNearby,  // descends from the position before
  // The same, and anywhere for a track that has not been placed yet.
  kWhereKnown,
  kStays,
};

/// Decides which observations fit, with the cameras fixed, and which tracks make a point or a
/// direction. Frames left with too few observations become weak.
/// @param round          its threshold, and its loss, by which positions are compared.
/// @param placement      how a track's position is found.
void ClassifyAll(const BundleRound& round,
                 Placement placement,
                 const BundleOptions& options,
                 BundleState& state);

/// How wide the residuals of the used observations are, in sigmas: their median, times what points
/// take off residuals by fitting them, the root of two measurements to an observation over those
/// less three (a point) or two (a direction) to a track. 0 where there are none.
double ResidualSpread(const BundleState& state);

/// Whether the errors of the used observations are larger along their blurs than across, as the
/// blurs say. It must be clearly likelier than equal errors, by Laplace's distribution with its
/// width fitted to either.
bool ShowsMotionBlur(const BundleState& state);

/// The observations that the points explain within the round's threshold, with the cameras fixed.
BundleSupport SupportWithin(const BundleRound& round,
                            const BundleOptions& options,
                            BundleState state);

/// Reprojection errors of the used observations of points.
ResidualStatistics Statistics(const BundleState& state);

}  // namespace rotslam
