#pragma once

#include <map>
#include <memory>
#include <optional>
#include <vector>

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

/// Grows a map keyframe by keyframe: known rotation for the new view and points, then bundle
/// adjustment of the newest keyframes. The first map, and the first one behind a turn in place to
/// an entirely new view, comes from the known rotations of at least three keyframes with parallax.
/// The cost of a keyframe does not depend on how many there were before, except for copying the
/// points.
class LiveMapper {
 public:
  /// Throws std::invalid_argument when an option is out of range.
  LiveMapper(const Camera& camera, const SlamOptions& options);

  /// @return  the map after it; null as long as there is none.
  std::shared_ptr<const LiveMap> AddKeyframe(const KeyframeInput& input);

 private:
  struct Keyframe {
    double timestamp_s = 0.0;
    Rotation cam_from_world;
    Rotation cam_from_odometry;  // as the odometry says, turn by turn
    double sigma_rad = 0.0;      // against the first one
    std::optional<Eigen::Vector3d> center_in_world;
    int part = 0;
  };

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
  std::vector<LivePoint> old_points_;         // of tracks that have ended; by track
  double depth_ = 0.0;                        // median, from the newest keyframe that sees points
  int part_ = 0;
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
