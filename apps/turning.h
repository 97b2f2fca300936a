#pragma once

#include <optional>
#include <vector>

#include "ba/turning.h"
#include "rotodom/types/maps.h"

namespace rotslam {

int NumObservations(const std::vector<Track>& tracks);

/// Measurements that a model has passed as checks: two for each observation that it explains, less
/// the numbers it was free to choose, three for a rotation or position and two (a direction) or
/// three (a point) for each track.
int Redundancy(const std::vector<BundleSummary>& bundles);
int Redundancy(const TurningResult& turning);

/// Rotations and a lens that explain a sequence better than a moving camera does. A calibration
/// that is off by some percent makes wide turns in place look like movement, and no pair of frames
/// can tell the two apart; all together can. Rotations alone are believed where another lens makes
/// them fit and they pass more checks than positions and points do, and at least a quarter of all;
/// a lens twice as long or more is not believed: a wall that a camera passes looks like a turn with
/// a lens six times as long.
/// @param redundancy  of positions and points; 0 where there are none.
/// Cost:  next to nothing where the camera does move: a sample of the tracks tells first.
std::optional<TurningResult> FindTurning(const Camera& camera,
                                         const RotationMap& cam_from_world,
                                         const std::vector<Track>& tracks,
                                         int redundancy,
                                         const BundleOptions& options);

}  // namespace rotslam
