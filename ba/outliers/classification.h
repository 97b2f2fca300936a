#pragma once

#include "ba/problem/bundle_state.h"
#include "ba/types/bundle_options.h"
#include "ba/types/bundle_result.h"

namespace rotslam {

/// Where classification looks for a track's position.
enum class Placement {
  // From all observations and from pairs: what is found goes by where the cameras are, not by how
  // they got there.
  kAnywhere,
  kNearby,  // from where it is, downhill
  // The same, and anywhere for a track that has not been placed yet.
  kWhereKnown,
  kStays,
};

/// Decides which observations fit, the cameras standing where they stand, and which tracks make a
/// point or a direction; frames left with too few observations become weak.
/// @param round          its limit, and its loss, by which positions are compared.
/// @param placement      where a track's position is looked for.
void ClassifyAll(const BundleRound& round,
                 Placement placement,
                 const BundleOptions& options,
                 BundleState& state);

/// How wide the residuals of the used observations are, in sigmas: their median, times what points
/// take off residuals by fitting them, the root of two measurements to an observation over those
/// less three (a point) or two (a direction) to a track. 0 where there are none.
double ResidualSpread(const BundleState& state);

/// Whether the used observations err along their blurs as much more than across as these say:
/// whether that is clearly likelier than that they err alike, by Laplace's distribution with its
/// width fitted to either.
bool ShowsMotionBlur(const BundleState& state);

/// What the points explain within the round's limit, the cameras standing where they stand.
BundleSupport SupportWithin(const BundleRound& round,
                            const BundleOptions& options,
                            BundleState state);

/// Reprojection errors of the used observations of points.
ResidualStatistics Statistics(const BundleState& state);

}  // namespace rotslam
