#pragma once

#include <map>
#include <optional>
#include <set>
#include <vector>

#include "apps/slam/live/keyframe_chain.h"
#include "apps/slam/live/live_map.h"
#include "apps/slam/live/mapper_input.h"
#include "rotodom/types/reconstruction.h"

namespace rotslam {

/// The data of a map that grows keyframe by keyframe: keyframes, tracks, points. Tracks keep their
/// observations while one of the newest keyframes sees them; of those that have ended only the
/// point stays. So the cost of a keyframe does not depend on the number of older ones.
class GrowingMap {
 public:
  // A track that none of so many newest keyframes sees has ended.
  static constexpr int kActiveKeyframes = 12;

  struct Keyframe {
    double timestamp_s = 0.0;
    Rotation cam_from_world;
    Rotation cam_from_odometry;  // orientation by the odometry, in the odometry's world
    double sigma_rad = 0.0;      // of the latter, against the first keyframe
    std::optional<Eigen::Vector3d> center_in_world;
    int component = 0;   // as in LiveKeyframe
    double scale = 1.0;  // by corrections, as in LiveKeyframe
  };

  /// By frame.
  const std::map<FrameId, Keyframe>& keyframes() const { return keyframes_; }
  bool has_points() const { return !points_.empty(); }
  /// All tracks that have not ended.
  const std::map<TrackId, Track>& tracks() const { return tracks_; }

  /// Adds a keyframe and what it sees, and takes over the odometry's orientations. The keyframe has
  /// a centre only where the camera has kept its place since the one before.
  void AddKeyframe(const KeyframeInput& input);
  /// Takes over the odometry's orientations; the poses in the map stay.
  void SetOdometry(const RotationMap& cam_from_world);
  /// Gives a keyframe a place in a component.
  void SetCenter(FrameId frame, const Eigen::Vector3d& center_in_world, int component);
  /// Takes over the poses and points of a component that was built anew: a keyframe from `first` on
  /// that `built` does not have loses its place, and so do points seen after `first`.
  void ReplaceFrom(FrameId first, const Reconstruction& built, int component);
  /// Takes over what bundle adjustment of `window` has found for its frames and its points. Points
  /// that it has dropped leave the map.
  void TakeAdjusted(const std::set<FrameId>& window,
                    const std::vector<Track>& tracks,
                    const Reconstruction& adjusted);
  /// Moves everything. Points move like the newest keyframe that sees them.
  void Move(const KeyframeMoves& moves);
  /// The keyframes of component `newer` belong to `older` from now on.
  void MergeComponents(int older, int newer);
  /// Gives the newer track of each pair the point of the older one, and the older observations.
  void MergePoints(const std::vector<const RevisitedPoint*>& points);
  /// Reduces the tracks that have ended to their points.
  void EndTracks();

  /// The newest keyframes and what they see. Keyframes from before a loop that see points of these
  /// belong to it, too.
  Reconstruction Recent() const;
  /// The frames of a window that have kept their place since another frame of it, to that frame.
  std::map<FrameId, FrameId> SharedCenters(const std::set<FrameId>& window) const;
  /// The keyframes that have a place.
  KeyframeChain Chain() const;
  /// A point by any of its tracks; null where there is none.
  const Eigen::Vector3d* FindPoint(TrackId track) const;
  /// The map as it is now, with revision 0.
  LiveMap Snapshot() const;

 private:
  // The point of a track that has ended.
  struct OldPoint {
    LivePoint point;
    FrameId keyframe;  // the newest one that has seen it
  };

  void AddObservations(FrameId frame, const Features& features);
  const OldPoint* FindOldPoint(TrackId track) const;

  std::map<FrameId, Keyframe> keyframes_;
  std::map<FrameId, FrameId> shared_center_;  // of pure rotations, to the keyframe at their start
  std::map<TrackId, Track> tracks_;
  PointMap points_;                   // of tracks_
  std::vector<OldPoint> old_points_;  // by track
  std::map<TrackId, TrackId>
      merged_into_;              // of points seen again: the track that has the point now
  std::set<TrackId> revisited_;  // those of tracks_ into which another one was merged
  int num_corrections_ = 0;
  Similarity moved_;  // the surroundings of the newest keyframe, by all corrections
};

}  // namespace rotslam
