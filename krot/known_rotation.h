#pragma once

#include <map>
#include <vector>

#include "krot/krot_options.h"
#include "krot/krot_solution.h"
#include "rotodom/camera/camera.h"
#include "rotodom/types/maps.h"
#include "rotodom/types/track.h"

namespace rotslam {

/// Finds camera centres and points, rotations being known.
/// @param cam_from_world  one rotation per view named in `tracks`; further ones are ignored.
/// @param tracks          bearings unit, in the camera frame.
/// @param camera          converts pixels to normalised units (MeanFocal) and nothing else.
/// @param sigma_rad       standard deviations of the orientations against the first one, where
///                        known. Between views the difference of their variances counts, as for
///                        an odometry's chain: what views share moves them together.
/// @return  see KrotSolution. Throws std::invalid_argument when an option is out of range, a track
///          names a view without rotation, or the camera has no focal length.
/// Error:   truth to 1e-6 (relative to the scene) on clean scenes (KnownRotation tests).
/// Cost:    one thread, sequences with tracks of 5 to 7 views: 44 views and 50,000 observations
///          0.5 s and 0.4 s more for the bracket, 67 and 89,000 1.2 s and 0.6 s, 100 and 149,000
///          2.7 s and 1.6 s. The start grows like the observations to the power 1.5.
/// Source:  Kahl & Hartley, Multiple-View Geometry under the L-infinity Norm, PAMI 2008, for the
///          bracket; Dalalyan & Keriven, L1-penalized robust estimation for a class of inverse
///          problems arising in multiview geometry, NIPS 2009, for the L1 start; resection as in
///          Zhang, Chin et al., A Fast Resection-Intersection Method for the Known Rotation
///          Problem, CVPR 2018.
KrotSolution SolveKnownRotation(const RotationMap& cam_from_world,
                                const std::vector<Track>& tracks,
                                const Camera& camera,
                                const KrotOptions& options,
                                const std::map<FrameId, double>& sigma_rad = {});

}  // namespace rotslam
