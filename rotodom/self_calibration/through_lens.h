#pragma once

#include <cstdint>

#include "rotodom/camera/camera.h"
#include "rotodom/odometry.h"

namespace rotslam {

/// The result of an odometry as it would be through another lens, without tracking again: bearings
/// of all features, the relative rotations of all edges from the points that their views share, and
/// orientations averaged over them. Edges that the points do not determine are left out.
/// @param tracked  with features and matches (OdometryResult::Add).
/// Cost:    a relative rotation for each edge.
OdometryResult ThroughLens(const OdometryResult& tracked,
                           const Camera& camera,
                           const OdometryOptions& options,
                           std::uint64_t seed,
                           int num_threads);

/// Relative rotations as their views would show them through another lens, from the rotations
/// alone: those that lead a grid of pixels to the same pixels as before. Edges whose views share
/// too little of the grid stay as they are. What a lens that is off makes of parallax stays in
/// them, and enters their covariances. Error:   a tenth of the change where the camera moves; exact
/// for rotations (tests).
ViewGraph TurnedThroughLens(const ViewGraph& graph, const Camera& from, const Camera& to);

}  // namespace rotslam
