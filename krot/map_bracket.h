#pragma once

#include "krot/bracket/bisection_options.h"
#include "krot/krot_options.h"
#include "rotodom/camera/camera.h"
#include "rotodom/types/reconstruction.h"

namespace rotslam {

/// How far the largest residual of a map is from the least that its rotations allow. Residuals are
/// per image axis, unit focal length.
struct MapBracket {
  BisectionStatus status = BisectionStatus::kIterationLimit;
  double largest_residual = 0.0;  // of the map itself
  // Over all centres and points, the least possible largest residual lies in [gamma_low,
  // gamma_high]; gamma_high is at most largest_residual.
  double gamma_low = 0.0;
  double gamma_high = 0.0;
  int num_observations = 0;  // that it covers: those less than 80 deg off the axis
  int num_tracks = 0;
  int num_programs = 0;
  double seconds = 0.0;
};

/// Brackets the least possible largest residual of a map's observations, its rotations being held;
/// its centres and points are the first structure.
/// @param map      of one component: poses of all frames and points of all tracks; observations
///                 with finite unit bearings of `camera`.
/// @param options  without use_bracket, and beyond max_bracket_views, the map's own residual is the
///                 upper bound and nothing is proven. The gap is kMapBracketGap or relative_gap,
///                 whichever is wider.
/// @return  see MapBracket; all zero for a map without observations. Throws std::invalid_argument
///          where MinimiseMaxResidual does, std::out_of_range for a frame without a pose.
/// Cost:    of MinimiseMaxResidual from a near start, without its last digits: 57 views and 68,000
///          observations 0.2 s.
/// Source:  as SolveKnownRotation's bracket.
MapBracket BracketMap(const Reconstruction& map, const Camera& camera, const KrotOptions& options);

/// Gap at which the search ends. At 0.3 the search takes about twice as long. The gap is small
/// against the five to ten times by which the thresholds of the start are wider than such a map.
inline constexpr double kMapBracketGap = 0.5;

}  // namespace rotslam
