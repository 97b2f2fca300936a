#pragma once

#include <set>

#include "ba/bundle_adjustment.h"

namespace rotslam {

/// The problem with which RefineBundle refines only the newest frames of a stream. They and the
/// points they see move; older frames that see those points are fixed and hold the gauge; all else
/// is left out, so that the cost does not grow with the stream.
/// @param map     poses, points and tracks so far, of all frames.
/// @param window  frames to refine; those without a pose are left out.
/// @return  a problem whose `fixed_frames` are the older ones; empty when `window` names no pose.
///          With no older frame that shares a track nothing is fixed, and the gauge is that of the
///          window's first frame.
BundleProblem WindowProblem(const Reconstruction& map,
                            const Camera& camera,
                            const std::set<FrameId>& window);

/// Puts what a window has refined back into the map: its frames' poses, its points, and their
/// tracks with the observations that fit. Tracks that no longer fit leave the map.
void TakeWindow(const BundleProblem& window, const BundleResult& refined, Reconstruction& map);

}  // namespace rotslam
