#pragma once

#include <deque>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "rotodom/averaging/averaging.h"
#include "rotodom/view_graph/connect.h"

namespace rotslam {

struct OdometryOptions {
  FeatureOptions features;
  MatchingOptions matching;
  RelativeRotationOptions relative_rotation;
  ViewGraphOptions view_graph;
  AveragingOptions averaging;

  std::optional<std::string> Problem() const;

  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("features", features);
    visit("matching", matching);
    visit("relative_rotation", relative_rotation);
    visit("view_graph", view_graph);
    visit("averaging", averaging);
  }
};

/// What one frame brought.
struct FrameReport {
  FrameId frame;
  int num_features = 0;
  int num_edges = 0;
  int num_inliers = 0;          // of the best edge
  bool predicted_only = false;  // no edge: the orientation is the constant-velocity prediction
  bool weak = false;            // its best edge has fewer inliers than asked for
  bool searched_wide = false;   // the prediction did not guide the matching
};

/// What is known when the sequence has ended.
struct OdometryResult {
  ViewGraph graph;
  RotationMap cam_from_world;  // one entry per frame
  std::vector<EdgeMatches> edge_matches;
  std::map<FrameId, Features> features;  // descriptors left out
};

/// Orientations from 2-D matches alone, frame by frame: features, edges to the frames before,
/// windowed averaging. Owns all that survives a frame. Source:  Chng et al., Monocular Rotational
/// Odometry with Incremental Rotation Averaging and Loop Closure.
class RotationalOdometry {
 public:
  /// Throws std::invalid_argument when an option or the camera is out of range.
  RotationalOdometry(const Camera& camera,
                     const OdometryOptions& options,
                     std::uint64_t seed,
                     int num_threads);

  /// Takes the next frame; frame ids and timestamps must ascend. An empty image gets the predicted
  /// orientation and no edge.
  FrameReport AddFrame(FrameId frame, double timestamp_s, const cv::Mat& image);

  /// The state so far; valid until the next frame.
  const OdometryResult& result() const { return result_; }
  /// The same, moved out of an odometry that is no longer needed.
  OdometryResult TakeResult() && { return std::move(result_); }

 private:
  Rotation PredictOrientation(double timestamp_s) const;
  void KeepGoodConnections(std::vector<Connection>& connections, FrameReport& report) const;
  void StartFromBestEdge(FrameId frame, const std::vector<Connection>& connections);
  void AverageWindow();

  Camera camera_;
  OdometryOptions options_;
  std::uint64_t seed_;
  int num_threads_;

  std::deque<View> recent_;  // newest last
  std::map<FrameId, double> timestamps_s_;
  OdometryResult result_;
};

}  // namespace rotslam
