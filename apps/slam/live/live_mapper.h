#pragma once

#include <map>
#include <memory>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "apps/slam/live/keyframe_chain.h"
#include "apps/slam/live/live_map.h"
#include "apps/slam/options.h"
#include "rotodom/camera/camera.h"
#include "rotodom/features/features.h"
#include "rotodom/types/reconstruction.h"

namespace rotslam {

/// What a keyframe of a live session brings to the map.
struct KeyframeInput {
  FrameId frame;
  double timestamp_s = 0.0;
  // Of this keyframe and those before it, by the odometry, in a world of its own; those of the
  // newest frames are not settled yet.
  RotationMap cam_from_world;
  std::map<FrameId, double> sigma_rad;  // of these, against the first frame
  bool only_rotated = false;            // since the keyframe before the camera has kept its place
  Features features;                    // with tracks
};

/// A point that a loop has shown to be the same.
struct RevisitedPoint {
  TrackId older;
  TrackId newer;
  std::vector<Observation> observations;  // of the older one, in keyframes around the older place
};

/// An older place that the camera has come back to, and the keyframe nearest to it.
struct RevisitedPlace {
  FrameId older;
  std::vector<RevisitedPoint> points;
};

/// What loops bring to the map.
struct LoopInput {
  RotationMap cam_from_world;  // of all keyframes, by the odometry, after averaging
  std::vector<RevisitedPlace> places;
};

/// Grows a map keyframe by keyframe: known rotation for the new view and points, then bundle
/// adjustment of the newest keyframes. The first map, and the first one behind a turn in place to
/// an entirely new view, comes from the known rotations of at least three keyframes with parallax.
/// The cost of a keyframe does not depend on how many there were before, except for copying the
/// points. Where a loop closes, all keyframes and points move (CloseLinks), and the newest
/// keyframes are adjusted against the older ones that see the same points.
class LiveMapper {
 public:
  /// Throws std::invalid_argument when an option is out of range.
  LiveMapper(const Camera& camera, const SlamOptions& options);

  /// @return  the map after it; null as long as there is none.
  std::shared_ptr<const LiveMap> AddKeyframe(const KeyframeInput& input);

  /// Moves the map as loops have it, where it contradicts them; what keyframes to come see of the
  /// older places is tied to these.
  /// @return  the map after it; null as long as there is none.
  std::shared_ptr<const LiveMap> CloseLoops(const LoopInput& input);

 private:
  struct Keyframe {
    double timestamp_s = 0.0;
    Rotation cam_from_world;
    Rotation cam_from_odometry;  // as the odometry says, turn by turn
    double sigma_rad = 0.0;      // against the first one
    std::optional<Eigen::Vector3d> center_in_world;
    int part = 0;
    double scale = 1.0;  // by corrections
  };

  // A point of a track that has ended, and the newest keyframe that has seen it.
  struct OldPoint {
    LivePoint point;
    FrameId keyframe;
  };

  KeyframeChain Chain() const;
  const OldPoint* FindOldPoint(TrackId track) const;
  const Eigen::Vector3d* FindPointOf(TrackId track) const;
  struct FoundLink {
    PlaceLink link;
    std::vector<const RevisitedPoint*> points;  // that agree with it
  };
  // Where the newer keyframe of a revisited place is by the points of the older one; nullopt where
  // too few of them agree.
  std::optional<FoundLink> FindLink(const RevisitedPlace& place,
                                    const KeyframeChain& chain,
                                    const RotationMap& cam_from_world) const;
  bool IsOff(const KeyframeChain& chain,
             const RotationMap& cam_from_world,
             const std::vector<PlaceLink>& links) const;
  void MoveMap(const std::map<FrameId, Similarity>& moves);
  void MergeParts(int older, int newer);
  void MergePoints(const std::vector<const RevisitedPoint*>& points);
  void AddObservations(FrameId frame, const Features& features);
  Reconstruction RecentMap() const;
  // Places the newest keyframe by the points of the map.
  bool Extend();
  bool PlaceNewest();
  void BeginPart();
  // Builds the part that has begun, all of its keyframes together.
  bool StartPart();
  void TakePart(const Reconstruction& part);
  void AdjustWindow();
  void ArchiveTracks();
  void Publish();

  Camera camera_;
  KrotOptions krot_options_;
  BundleOptions window_options_;
  BundleOptions start_options_;

  std::map<FrameId, Keyframe> keyframes_;
  std::map<FrameId, FrameId> shared_center_;  // of pure rotations, to the keyframe at their start
  std::map<TrackId, Track> tracks_;           // seen of late
  PointMap points_;                           // of these
  std::vector<OldPoint> old_points_;          // of tracks that have ended; by track
  // Of points seen again: the track that has their point now.
  std::map<TrackId, TrackId> merged_into_;
  std::set<TrackId> revisited_;                     // of these, the tracks that are still seen
  std::vector<std::pair<FrameId, FrameId>> links_;  // closed loops: older and newer keyframe
  int num_corrections_ = 0;
  Similarity moved_;    // what lies around the newest keyframe, by all corrections
  double depth_ = 0.0;  // median, from the newest keyframe that sees points
  int part_ = 0;
  int num_parts_ = 1;
  // Of the part that has begun: its first keyframe, whether it is built anew with every keyframe,
  // where it begins, and the median depth that its first keyframe is to see.
  std::optional<FrameId> first_;
  bool is_young_ = true;
  Eigen::Vector3d part_center_ = Eigen::Vector3d::Zero();
  double part_depth_ = 1.0;
  int revision_ = 0;
  std::shared_ptr<const LiveMap> map_;
};

}  // namespace rotslam
