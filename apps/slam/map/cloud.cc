#include "apps/slam/map/cloud.h"

#include <utility>

#include "ba/bundle_adjustment.h"

namespace rotslam {

Reconstruction MakeCloudOf(const CloudSources& sources,
                           std::vector<Track> tracks,
                           const BundleOptions& options) {
  BundleProblem problem;
  problem.camera = sources.camera;
  problem.start.cam_from_world = sources.cam_from_world;
  problem.start.center_in_world = sources.center_in_world;
  problem.start.point_in_world = sources.point_in_world;
  problem.start.tracks = std::move(tracks);
  std::erase_if(problem.start.tracks, [](const Track& track) {
    return static_cast<int>(track.observations.size()) < kMinTrackObservations;
  });
  for (const PureRotationSegment& segment : sources.segments) {
    for (const auto& [frame, rotation] : sources.cam_from_world) {
      if (segment.first < frame && frame <= segment.last)
        problem.shared_center[frame] = segment.first;
    }
  }
  return TriangulateTracks(std::move(problem), options);
}

}  // namespace rotslam
