#pragma once

#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "rotodom/averaging/averaging.h"
#include "rotodom/averaging/orientation_covariance.h"
#include "rotodom/motion_blur/exposure.h"
#include "rotodom/rolling_shutter/rolling_shutter.h"
#include "rotodom/tracking/recovery.h"
#include "rotodom/tracking/tracking.h"
#include "rotodom/view_graph/estimate_edges.h"

namespace rotslam {

/// All stages of rotational odometry. The defaults run a real sequence untouched.
struct OdometryOptions {
  FeatureOptions features;
  MatchingOptions matching;
  TrackingOptions tracking;
  RelativeRotationOptions relative_rotation;
  ViewGraphOptions view_graph;
  AveragingOptions averaging;

  std::optional<std::string> Problem() const;

  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("features", features);
    visit("matching", matching);
    visit("tracking", tracking);
    visit("relative_rotation", relative_rotation);
    visit("view_graph", view_graph);
    visit("averaging", averaging);
  }
};

/// How well one frame did.
struct FrameReport {
  int num_tracked = 0;          // features carried on from older frames
  int num_inliers = 0;          // of the best edge
  bool predicted_only = false;  // no edge: the orientation is the prediction
  bool weak = false;            // its best edge has fewer inliers than asked for
  bool searched_wide = false;   // tracking failed, descriptors were matched instead
};

/// Time spent in each stage since the start, s.
struct OdometrySeconds {
  double pyramid = 0.0;
  double tracking = 0.0;  // recovery and the time of exposure included
  double detection = 0.0;
  double edges = 0.0;  // relative rotations
  double averaging = 0.0;
  double covariance = 0.0;
};

/// The result for one frame.
struct FrameEstimate {
  FrameId frame;
  double timestamp_s = 0.0;
  Rotation cam_from_world;
  // Of the error delta in Exp(delta) * cam_from_world against the first frame, rad^2; nullopt
  // where nothing is known.
  std::optional<Eigen::Matrix3d> covariance;
  // Every orientation that this frame has moved, its own included; older ones are settled.
  RotationMap window;
  // The oldest of them, and its covariance.
  FrameId settled;
  std::optional<Eigen::Matrix3d> settled_covariance;
  std::vector<EdgeWithMatches> connections;  // the frame's edges, to the newest view first
  // Edges and features of the frame before, measured again now that its points are seen from both
  // sides, at the beginning also of those before; for a rolling shutter only.
  std::vector<RelativeRotation> revised_edges;
  std::vector<Features> revised_features;
  // Descriptors left out; for a rolling shutter, the keypoints that a global one would have seen.
  Features features;
  FrameReport report;
};

/// Orientations from 2-D matches alone, frame by frame: points tracked from image to image, edges
/// to the frames before and to older keyframes, windowed averaging. Owns all that survives a
/// frame, which is bounded: the newest views, some keyframes, and the window's edges.
/// Source:  Chng et al., Monocular Rotational Odometry with Incremental Rotation Averaging and
/// Loop Closure; ours tracks points instead of matching each pair of frames anew.
class RotationalOdometry {
 public:
  /// Throws std::invalid_argument when an option or the camera is out of range.
  RotationalOdometry(const Camera& camera,
                     const OdometryOptions& options,
                     std::uint64_t seed,
                     int num_threads);

  /// Takes the next frame; frame ids and timestamps must ascend. An empty image gets the predicted
  /// orientation and no edge.
  /// @param image  of the camera's size; its masked parts are ignored.
  FrameEstimate AddFrame(FrameId frame, double timestamp_s, const MaskedImage& image);

  /// All that later frames depend on, as bytes for RestoreState(). Some megabytes: the grey images
  /// of the newest views are in it.
  std::string SaveState();

  /// Goes on, to the last bit, where an odometry stood that was made with the same arguments (but
  /// for the number of threads) by the same program. Throws std::runtime_error when the bytes are
  /// cut short; bytes damaged otherwise are for the caller to notice.
  void RestoreState(std::string_view state);

  const OdometrySeconds& seconds() const { return seconds_; }

  /// Exposure time as the newest images tell it, s (ExposureMeter::Seconds()).
  double exposure_s() const { return exposure_.Seconds(); }

  /// Covariance of a frame that is still in the window, as in FrameEstimate.
  std::optional<Eigen::Matrix3d> CovarianceOf(FrameId frame) const;

  /// Covariance of the turn from frame i to frame j, both still in the window: of the error delta
  /// in Exp(delta) * camj_from_cami, rad^2. The errors that the two share are not in it.
  std::optional<Eigen::Matrix3d> CovarianceBetween(FrameId i, FrameId j) const;

 private:
  // Throws std::invalid_argument where the frame cannot follow those before.
  void CheckNext(FrameId frame, double timestamp_s, const cv::Mat& image) const;
  ImagePyramid BuildPyramidOf(const MaskedImage& image);
  Rotation PredictOrientation(double timestamp_s) const;
  // Of a frame after all others, at the mean rate since the one before. Drawing that out to the
  // frame itself by the last change measured worse: accelerations of hand-held cameras do not last.
  AngularMotion NewestMotion(double timestamp_s, const Rotation& cam_from_world) const;
  std::vector<OrientedView> RecentViews() const;
  TrackingResult Track(const std::vector<OrientedView>& views,
                       const TrackingTarget& target,
                       FrameEstimate& estimate);
  void AppendTracked(const TrackingResult& tracked,
                     const std::vector<OrientedView>& views,
                     View& view) const;
  void DetectNewFeatures(const cv::Mat& image, View& view);
  // @param others  that are taken with it, before or after it.
  void CorrectRollingShutterOf(View& view, const std::vector<const View*>& others) const;
  // Of the present view, and once more of those before it, whose edges are measured again.
  void CorrectRollingShutters(View& view, FrameEstimate& estimate);
  // Measures the edges to older views again, as far as these are remembered.
  std::vector<EdgeWithMatches> MeasureEdgesAgain(const Features& view) const;
  void Connect(const View& view, FrameEstimate& estimate);
  std::vector<const Features*> Partners(const View& view) const;
  void KeepGoodEdges(FrameEstimate& estimate) const;
  void AverageWindow(FrameEstimate& estimate);
  void UpdateCovariance(FrameEstimate& estimate);
  // None with a rolling shutter: matching blur there drifts less on renderings (RPE_n 0.44 and 0.26
  // deg), and more with the one real camera that was tried (TUM fr1_rpy, 2.8 and 3.9 deg).
  double ExposureToMatch() const;
  // By the newest of the older views, whose rate is known from both sides, and one of those before.
  void MeasureExposure();
  // Drops what no later frame can refer to.
  void DropOldViews();
  void UpdateFlow(const TrackingResult& tracked,
                  const std::vector<OrientedView>& views,
                  View& view) const;
  void UpdateKeyframes(std::shared_ptr<View> view);
  template <class Archive>
  void Transfer(Archive& archive);

  Camera camera_;
  OdometryOptions options_;
  std::uint64_t seed_;
  int num_threads_;

  std::deque<std::shared_ptr<View>> recent_;     // newest first
  std::deque<std::shared_ptr<View>> keyframes_;  // newest first, those not recent without images
  ViewGraph graph_;
  RotationMap cam_from_world_;
  std::map<FrameId, double> timestamps_s_;
  OrientationCovariance covariance_;
  OdometrySeconds seconds_;
  int next_track_ = 0;
  ExposureMeter exposure_;
};

/// The result for a sequence: the estimates of all frames together.
struct OdometryResult {
  ViewGraph graph;
  RotationMap cam_from_world;  // one entry per frame
  std::vector<EdgeMatches> edge_matches;
  std::map<FrameId, Features> features;
  // As in FrameEstimate; frames whose uncertainty is not known are missing.
  std::map<FrameId, Eigen::Matrix3d> covariance;

  /// Adds the next frame's estimate. Tracks need features and matches; without them what is kept
  /// is small.
  void Add(FrameEstimate estimate, bool keep_features);
};

}  // namespace rotslam
