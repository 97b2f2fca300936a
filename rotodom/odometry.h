#pragma once

#include <deque>
#include <map>
#include <optional>
#include <string>
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

  const ViewGraph& graph() const { return graph_; }
  const RotationMap& cam_from_world() const { return cam_from_world_; }  // one entry per frame
  const std::vector<EdgeMatches>& edge_matches() const { return edge_matches_; }
  const std::map<FrameId, Features>& features() const { return features_; }  // descriptors left out

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
  ViewGraph graph_;
  RotationMap cam_from_world_;
  std::vector<EdgeMatches> edge_matches_;
  std::map<FrameId, Features> features_;
};

}  // namespace rotslam
