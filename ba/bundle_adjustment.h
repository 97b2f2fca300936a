#pragma once

#include <functional>
#include <vector>

#include "ba/types/bundle_options.h"
#include "ba/types/bundle_problem.h"
#include "ba/types/bundle_result.h"
#include "rotodom/camera/camera.h"
#include "rotodom/types/reconstruction.h"

namespace rotslam {

/// Finds more observations of points whose projections are known to a few pixels.
/// @param map     poses, points and tracks, with the observations that fit.
/// @param camera  as it is refined; the observations' bearings are its.
/// @return  tracks of the map with other observations.
using TrackCompletion =
    std::function<std::vector<Track>(const Reconstruction& map, const Camera& camera)>;

/// Minimises the robust reprojection error over rotations, centres and points, in rounds that start
/// with the rotations held (`options.fixed_rotation`) and then free them (`options.coarse`,
/// `options.fine`). Before every round all tracks are triangulated anew against the cameras of that
/// moment and all observations are classified anew, so that a good observation that a poor start
/// has rejected comes back.
/// @param problem  as documented there. Throws std::invalid_argument on numbers that are
/// not finite, sigmas that are not positive, doubled track ids or frames within a track, frames in
/// `shared_center` or `fixed_frames` without a pose, cycles in `shared_center`.
/// @param complete  when given, called after the preparing rounds; the tracks it returns take the
/// place of those with their ids.
/// @return  status kTooLittleData for an empty problem or one without parallax; else the gauge of
/// the start: the first well-observed frame keeps its pose to the last bit and the farthest centre
/// its distance along the line between them. With `fixed_frames` these keep theirs. Same bytes at
/// any `options.num_threads`.
/// Error:   truth to 1e-6 of the path length on clean scenes (ba tests).
/// Cost:    per iteration linear in observations plus a Cholesky of 6 unknowns per camera; three
/// rounds of 67 cameras, 13,000 points and 84,000 observations take 2 to 3 s.
/// Source:  Triggs et al., Bundle Adjustment - A Modern Synthesis, 1999; the chain of rounds is
/// ours.
BundleResult RefineBundle(const BundleProblem& problem,
                          const BundleOptions& options,
                          const TrackCompletion& complete = nullptr);

/// Triangulates all tracks of `problem` against its cameras, which stay as they are, and keeps the
/// observations within `options.fine.max_error_px`: more points, seen from more frames, for a
/// cloud. Points of the start are where theirs are looked for first.
/// Memory:  that of `problem`, when it is moved in; of a long sequence its tracks are most of what
///          is kept.
/// @return  the poses of the start with those points and tracks; the same contract as RefineBundle.
Reconstruction TriangulateTracks(BundleProblem problem, const BundleOptions& options);

/// The reconstruction without the points (and their tracks) whose rays nowhere meet at
/// `min_angle_deg`. Shallow points help rotations but spread along the line of sight, which is not
/// what one wants to look at.
Reconstruction WithoutShallowPoints(Reconstruction reconstruction, double min_angle_deg);

}  // namespace rotslam
