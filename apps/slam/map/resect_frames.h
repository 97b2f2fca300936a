#pragma once

#include <map>
#include <vector>

#include "ba/resection.h"
#include "rotodom/camera/camera.h"
#include "rotodom/types/maps.h"
#include "rotodom/types/track.h"

namespace rotslam {

/// Position between the nearest frames that have one, linear in time; before the first and behind
/// the last, theirs.
/// @param centers  at least one.
Eigen::Vector3d InterpolatedCenter(const CenterMap& centers,
                                   const std::vector<double>& timestamps_s,
                                   FrameId frame);

/// Poses of frames by the points of a map that they see; without those that ResectFrame fails for.
/// @param tracks  of the frames, those of the points among them.
std::map<FrameId, ResectedPose> ResectFrames(const std::map<FrameId, ResectionStart>& starts,
                                             const PointMap& points,
                                             const std::vector<Track>& tracks,
                                             const Camera& camera,
                                             const ResectionOptions& options,
                                             int num_threads);

}  // namespace rotslam
