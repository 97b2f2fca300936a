#pragma once

#include <array>
#include <compare>
#include <cstdint>
#include <iterator>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "rotodom/types/ids.h"
#include "rotodom/types/maps.h"

namespace rotslam {

/// One observation of a scene point in an image.
struct Observation {
  FrameId frame;
  Eigen::Vector2d
      keypoint_px;  // where the distorted image shows it; pixel centres at integer coordinates
  Eigen::Vector3d bearing;  // unit vector to it in the camera frame
  double sigma_px = 1.0;    // standard deviation of the keypoint, per image axis
  // Along this, in the image, the keypoint is less certain: a standard deviation of hypot(1,
  // |blur|) times sigma_px. What moves while it is exposed is blurred.
  Eigen::Vector2f blur = Eigen::Vector2f::Zero();
};

/// Takes an error of a blurred keypoint, in pixels, to one that is as certain in every direction as
/// that one is across: the inverse root of the covariance I + blur blur^T.
/// @param blur  as of Observation.
Eigen::Matrix2d Deblurring(const Eigen::Vector2f& blur);

/// One scene point seen in several frames: at most one observation per frame, frames ascending.
struct Track {
  TrackId id;
  std::vector<Observation> observations;
  std::array<std::uint8_t, 3> rgb = {128, 128, 128};
};

/// An observation, by its indices in a list of tracks.
struct ObservationIndex {
  int track = 0;
  int observation = 0;
  auto operator<=>(const ObservationIndex&) const = default;
};

/// The ray of a track from the camera that sees it.
struct TrackRay {
  int track = 0;                 // index in the list of tracks
  Eigen::Vector3d ray_in_world;  // unit
};

/// By frame, the rays of the tracks that it sees, in the order of the tracks; frames without a
/// rotation are absent.
std::map<FrameId, std::vector<TrackRay>> RaysByFrame(const RotationMap& cam_from_world,
                                                     const std::vector<Track>& tracks);

/// Restricts the tracks to the observations that fulfil `keep`; tracks with fewer than `min_length`
/// of them are dropped.
template <class Keep>
std::vector<Track> RestrictTracks(const std::vector<Track>& tracks,
                                  const Keep& keep,
                                  int min_length) {
  std::vector<Track> restricted;
  for (const Track& track : tracks) {
    Track kept{track.id, {}, track.rgb};
    for (const Observation& observation : track.observations) {
      if (keep(observation)) kept.observations.push_back(observation);
    }
    if (std::ssize(kept.observations) >= min_length) restricted.push_back(std::move(kept));
  }
  return restricted;
}
/// The same for the observations in `frames`.
std::vector<Track> RestrictTracks(const std::vector<Track>& tracks,
                                  const std::set<FrameId>& frames,
                                  int min_length);

/// Observations of all of them.
int NumObservations(const std::vector<Track>& tracks);

}  // namespace rotslam
