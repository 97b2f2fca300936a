#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "apps/paper_method/paper_graph.h"
#include "apps/paper_method/paper_loops.h"
#include "rotodom/camera/camera.h"
#include "rotodom/loop/loop_closure.h"
#include "rotodom/odometry.h"

namespace rotslam {

/// Options of PaperOdometry.
struct PaperOdometryOptions {
  OdometryOptions odometry;  // PaperDefaults
  bool use_loops = true;
  CandidateOptions candidates;                             // of loops
  std::shared_ptr<const Vocabulary> vocabulary = nullptr;  // null: DefaultVocabulary
  // Its solver and averager, where the paper's shall be exchanged; the rest is set by the above.
  PaperGraphOptions graph;
  std::uint64_t seed = 1;
  int num_threads = 1;
};

/// Time spent so far, s.
struct PaperSeconds {
  double extraction = 0.0;
  double matching = 0.0;
  double graph = 0.0;  // relative rotations and averaging
  double loops = 0.0;  // averaging of all included
};

/// The result for one frame.
struct PaperFrame {
  FrameId frame;
  Rotation cam_from_world;
  int num_features = 0;
  std::vector<RelativeRotation> edges;  // to the frames before it, the newest first
  bool predicted_only = false;
  std::vector<LoopCheck> loops;
  bool has_averaged = false;  // a loop has changed all orientations
};

/// Rotational odometry as the paper describes it, to compare our own with (Alg. 1): ORB features as
/// ORB-SLAM2 spreads them, matches with each of the |F| frames before, OpenGV's eigensolver in
/// RANSAC, averaging of the |R| newest orientations with equal weights, loops by visual words.
/// Rolling shutters are not corrected, orientations get no covariance, and memory grows with the
/// sequence.
/// Source:  Chng, Parra, Chin & Latif, Monocular Rotational Odometry with Incremental Rotation
///          Averaging and Loop Closure, DICTA 2020. Their program ends at a frame without an edge;
///          ours predicts it and goes on.
class PaperOdometry {
 public:
  /// Throws std::invalid_argument when an option or the camera is out of range.
  PaperOdometry(const Camera& camera, const PaperOdometryOptions& options);

  /// Takes the next frame, ids from 0 without gaps; an empty image gets the predicted orientation.
  /// The results do not depend on the number of threads.
  PaperFrame AddFrame(FrameId frame, const MaskedImage& image);

  const ViewGraph& graph() const { return graph_.graph(); }
  const RotationMap& cam_from_world() const { return graph_.cam_from_world(); }
  const PaperSeconds& seconds() const { return seconds_; }
  int num_places() const { return loops_ ? loops_->num_places() : 0; }

 private:
  std::shared_ptr<const OrbView> Extract(FrameId frame, const MaskedImage& image);
  std::vector<PairMatches> MatchWithWindow(const OrbView& view);
  PaperGraph::Step Connect(FrameId frame, std::span<const PairMatches> matches);
  void FindLoops(std::shared_ptr<const OrbView> view, PaperFrame& result);

  Camera camera_;
  PaperOdometryOptions options_;
  std::deque<std::shared_ptr<const OrbView>> window_;  // newest first
  PaperGraph graph_;
  std::optional<PaperLoops> loops_;
  PaperSeconds seconds_;
};

}  // namespace rotslam
