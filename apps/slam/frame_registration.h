#pragma once

#include <map>
#include <vector>

#include "apps/slam/positions.h"
#include "ba/resection.h"

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

/// Poses of the frames that `result.map` does not hold: resected against its points, their
/// orientations being measurements as good as AnchorCovariances says; in a segment, the place of
/// its end; interpolated where neither tells.
/// @param all_tracks  of all frames, those of the map's points among them.
/// @param result      has map, camera, segments, and orientations of all frames that follow the
///                    map's; gets the positions, better orientations and the counts.
void RegisterFrames(const Orientations& orientations,
                    const std::vector<Track>& all_tracks,
                    const PipelineOptions& options,
                    int num_threads,
                    PositionResult& result);

}  // namespace rotslam
