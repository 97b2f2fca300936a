#pragma once

#include <map>
#include <vector>

#include "krot/known_rotation.h"

namespace rotslam {

/// Places the newest views of a stream: the robust start's programs over the views that their
/// tracks reach, where every centre and point that is known already stays as it is, to the last
/// bit. The scale is that of what is known.
/// @param known   the solution so far; views are taken from the component of the newest view that
///                the tracks name.
/// @param tracks  of the window: the new views' tracks with all their observations. A track with a
///                known point adds to the new centres only.
/// @return  `known` with the new centres and points; gamma_high is the largest residual that
///          the new ones leave, there is no lower bound. kInfeasible when no new view shares
///          enough with the known ones; then nothing is added. Throws std::invalid_argument as
///          SolveKnownRotation does.
/// Cost:    as the start of SolveKnownRotation for the window's views; independent of what lies
///          before it.
KrotSolution ExtendKnownRotation(const KrotSolution& known,
                                 const RotationMap& cam_from_world,
                                 const std::vector<Track>& tracks,
                                 const Camera& camera,
                                 const KrotOptions& options);

}  // namespace rotslam
