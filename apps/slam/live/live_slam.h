#pragma once

#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "apps/slam/live/live_map.h"
#include "apps/slam/live/map_thread.h"
#include "apps/slam/orientation_collector.h"
#include "apps/slam/slam.h"

namespace rotslam {

/// How the pose of a frame of a live session was found.
enum class LiveState {
  kStarting,      // there is no map yet of what the camera sees, and no position
  kTracking,      // by points of the map
  kRotating,      // the camera turns in place: the position is held
  kStill,         // the camera is at rest: the position is held
  kExtrapolated,  // too few points: the position is carried on from the frames before, for a while
};

/// Name of a state as files write it.
const char* ToString(LiveState state);

/// The result for one frame of a live session.
struct LiveEstimate {
  FrameId frame;
  double timestamp_s = 0.0;
  // In the world of the map of `map_revision`, whose first frame has the identity until a loop
  // turns it.
  Rotation cam_from_world;
  // Of the error delta in Exp(delta) * cam_from_world against the first frame, rad^2; nullopt where
  // nothing is known.
  std::optional<Eigen::Matrix3d> covariance;
  std::optional<Eigen::Vector3d> center_in_world;
  LiveState state = LiveState::kStarting;
  int num_points = 0;    // of the map that agree with the pose
  int map_revision = 0;  // 0: there is no map
};

/// Pose of a frame as the newest map has it.
struct LivePathPose {
  FrameId frame;
  double timestamp_s = 0.0;
  Rotation cam_from_world;
  std::optional<Eigen::Vector3d> center_in_world;  // nullopt where no map reaches
};

/// Options of a live session, beside SlamOptions.
struct LiveOptions {
  // The map with a keyframe is used so much later than the keyframe, s. Less brings new points
  // sooner; more leaves a slow machine more time before a frame has to wait for the map.
  double handover_s = 0.2;
  // Loops move the map. Off: they correct only orientations until the session ends.
  bool correct_map = true;
};

/// The whole system while the camera runs: a pose for every frame at once, and a map that grows on
/// a thread of its own. The poses depend on the frames alone, not on the speed of the machine or
/// the number of threads. Memory grows with the sequence, as that of RunSlam.
class LiveSlam {
 public:
  /// @param inputs  as RunSlam takes them; `log` is not used.
  /// Throws std::invalid_argument when the camera or an option is out of range.
  LiveSlam(const Camera& camera,
           const SlamOptions& options,
           const LiveOptions& live = {},
           const SlamInputs& inputs = {});
  LiveSlam(const LiveSlam&) = delete;
  LiveSlam& operator=(const LiveSlam&) = delete;

  /// Adds the next frame.
  /// @param image  8-bit, one channel or three (blue, green, red), of the camera's size; empty: it
  ///               could not be read, and the pose is a prediction.
  /// @param name   of the frame, for the masks of frames and for files.
  /// Throws std::invalid_argument where the size is another one or time does not ascend.
  LiveEstimate AddFrame(double timestamp_s, const cv::Mat& image, const std::string& name = {});

  /// The map that the newest pose refers to; null where there is none. It may be called from any
  /// thread at any time.
  std::shared_ptr<const LiveMap> Map() const;

  /// All frames so far in the newest map; empty while there is none. Loops have moved them, and
  /// frames that came before the map began have a position where it has points that they see. Call
  /// it from the thread that adds frames.
  std::vector<LivePathPose> Path() const;

  /// Finishes the session: the result is that of RunSlam for the same frames. No frame may be added
  /// afterwards.
  /// @param frames  the same frames once more, for stages that need their images again; null:
  ///                these are left out, and tracks are not completed. Where the images have
  ///                shown a rolling shutter or static content that was not known, all of them are
  ///                tracked again with that.
  /// Throws as RunSlam does.
  SlamResult Finish(FrameSource* frames, SlamObserver& observer);

  /// The first stage of Finish() alone, at the size that images are worked with.
  /// @param frames  reduced to that size.
  Orientations FinishOrientations(FrameSource* frames, SlamObserver& observer);

  /// Keypoints of the newest frame that are points of the map, px of the images that were given.
  std::vector<Eigen::Vector2d> SeenPointsPx() const;

  int num_frames() const { return num_frames_; }
  /// Time for which frames have waited for the map, s.
  double waited_s() const { return mapping_.waited_s(); }

 private:
  // A frame that is a keyframe or might become one.
  struct Candidate {
    FrameId frame;
    double timestamp_s = 0.0;
  };

  // A frame against a keyframe of the map.
  struct PathFrame {
    double timestamp_s = 0.0;
    std::optional<FrameId> keyframe;  // nullopt: there was no map
    double scale = 1.0;               // of that keyframe at that time
    Rotation cam_from_keyframe;
    std::optional<Eigen::Vector3d> center_in_keyframe;  // in its camera frame
  };

  void Place(const Features& features, LiveEstimate& estimate);
  void NotePath(const LiveEstimate& estimate);
  // Finds positions of a few frames that came before the map did.
  void PlaceEarlierFrames();
  void UpdateVelocity(const LiveEstimate& estimate);
  void SetState(LiveEstimate& estimate) const;
  void ChooseKeyframe(const Candidate& frame, double now_s);
  void AddKeyframe(const Candidate& frame, double now_s);
  // Moves the newest poses along with a map that loops have moved.
  void FollowCorrection(const LiveMap& map);
  // Collects the matches of the newest frame's loops: edges from `first_edge` on.
  void NoteLoops(std::size_t first_edge);
  FrameId KeyframeNearest(FrameId frame) const;
  void PostLoops(double now_s);
  ViewOverlap OverlapWithKeyframe(FrameId frame) const;
  std::vector<TrackRay> RaysOf(FrameId frame) const;
  const OdometryResult& odometry() const { return collector_.odometry(); }

  SlamOptions options_;
  LiveOptions live_;
  Camera original_camera_;
  WorkingSize working_;
  FrameMasks original_masks_;
  SlamInputs inputs_;  // of images at the size that is worked with
  OrientationCollector collector_;
  MapThread mapping_;
  std::optional<FoundInImages> found_;
  int num_frames_ = 0;

  std::optional<Candidate> keyframe_;  // the newest one
  std::vector<FrameId> keyframes_;
  std::vector<RevisitedPlace> revisited_;  // by loops that the map does not know of
  bool has_loops_ = false;                 // orientations have moved, or are about to
  std::optional<Candidate> before_;  // was asked before the newest one whether it is a keyframe
  std::optional<Candidate> newest_;  // the newest frame, where it has features
  std::optional<PureRotationSegment> rotation_;  // that the newest frame is in
  std::optional<LiveEstimate> last_;
  std::vector<PathFrame> path_;     // by frame
  std::deque<FrameId> unplaced_;    // frames without a position that the map has not reached yet
  std::deque<StampedPose> placed_;  // of late, by the map
  Eigen::Vector3d velocity_ = Eigen::Vector3d::Zero();  // per second

  mutable std::mutex mutex_;  // of the map
  std::shared_ptr<const LiveMap> map_;
};

}  // namespace rotslam
