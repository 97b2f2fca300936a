#pragma once

#include <map>
#include <vector>

#include "ba/resection.h"
#include "rotodom/camera/camera.h"
#include "rotodom/types/maps.h"
#include "rotodom/types/track.h"

namespace rotslam {

/// Position interpolated linearly in time between the nearest frames that have one; before the
/// first and after the last of them, the position of that frame.
/// @param centers  at least one.
Eigen::Vector3d InterpolatedCenter(const CenterMap& centers,
                                   const std::vector<double>& timestamps_s,
                                   FrameId frame);

/// The points of a map and the tracks that see them.
struct SeenMap {
  const PointMap& points;
  const std::vector<Track>& tracks;  // of the frames; must include the tracks of the points
};

/// Resects frames against the points of a map. Frames for which ResectFrame fails are left out.
std::map<FrameId, ResectedPose> ResectFrames(const std::map<FrameId, ResectionStart>& starts,
                                             const SeenMap& map,
                                             const Camera& camera,
                                             const ResectionOptions& options,
                                             int num_threads);

/// Checks frames against the points of a map without moving them: AssessPose for each.
std::map<FrameId, ResectedPose> AssessFrames(const std::map<FrameId, ResectionStart>& poses,
                                             const SeenMap& map,
                                             const Camera& camera,
                                             const ResectionOptions& options,
                                             int num_threads);

}  // namespace rotslam
