#include "rotodom/types/track.h"

#include <cmath>

namespace rotslam {

int NumObservations(const std::vector<Track>& tracks) {
  std::size_t count = 0;
  for (const Track& track : tracks) count += track.observations.size();
  return static_cast<int>(count);
}

Eigen::Matrix2d Deblurring(const Eigen::Vector2f& blur) {
  const Eigen::Vector2d s = blur.cast<double>();
  const double squared = s.squaredNorm();
  if (squared == 0.0) return Eigen::Matrix2d::Identity();
  return Eigen::Matrix2d::Identity() -
         (1.0 - 1.0 / std::sqrt(1.0 + squared)) / squared * s * s.transpose();
}

std::map<FrameId, std::vector<TrackRay>> RaysByFrame(const RotationMap& cam_from_world,
                                                     const std::vector<Track>& tracks) {
  std::map<FrameId, std::vector<TrackRay>> rays;
  for (int k = 0; k < static_cast<int>(tracks.size()); ++k) {
    for (const Observation& observation : tracks[k].observations) {
      const auto rotation = cam_from_world.find(observation.frame);
      if (rotation == cam_from_world.end()) continue;
      rays[observation.frame].push_back({k, rotation->second.Inverse() * observation.bearing});
    }
  }
  return rays;
}

std::vector<Track> RestrictTracks(const std::vector<Track>& tracks,
                                  const std::set<FrameId>& frames,
                                  int min_length) {
  const auto is_in_frames = [&](const Observation& observation) {
    return frames.contains(observation.frame);
  };
  return RestrictTracks(tracks, is_in_frames, min_length);
}

}  // namespace rotslam
