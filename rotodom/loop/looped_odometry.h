#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include <opencv2/core.hpp>

#include "rotodom/loop/loop_closure.h"
#include "rotodom/odometry.h"

namespace rotslam {

/// What one frame brought, loops included.
struct LoopedEstimate {
  FrameId frame;
  Rotation cam_from_world;
  // As in FrameEstimate: of the odometry, which loops can only make smaller.
  std::optional<Eigen::Matrix3d> covariance;
  FrameReport report;
  std::vector<LoopCheck> loops;  // what the frame before looked like
  bool has_averaged = false;     // a loop has moved the orientations of all frames
};

/// Rotational odometry that notices when the camera is back, and then spreads the drift over all
/// orientations. The odometry itself goes on undisturbed; its orientations are turned into the
/// world that the last averaging left. What is remembered grows with the sequence, unless loops are
/// off and neither features nor edges are asked for.
class LoopedOdometry {
 public:
  /// Throws std::invalid_argument when an option or the camera is out of range.
  /// @param vocabulary     null for the one that comes with the project.
  /// @param keep_features  for tracks.
  LoopedOdometry(const Camera& camera,
                 const OdometryOptions& odometry,
                 const LoopOptions& loops,
                 std::shared_ptr<const Vocabulary> vocabulary,
                 bool keep_features,
                 std::uint64_t seed,
                 int num_threads);

  /// Takes the next frame, as RotationalOdometry::AddFrame.
  LoopedEstimate AddFrame(FrameId frame, double timestamp_s, const cv::Mat& image);

  /// To be called after the last frame: averages once more when there were loops, and completes
  /// the covariances. What the last frame looked like.
  std::vector<LoopCheck> Finish();

  /// All frames so far.
  const OdometryResult& result() const { return result_; }
  OdometryResult&& TakeResult() { return std::move(result_); }

  const OdometrySeconds& odometry_seconds() const { return odometry_.seconds(); }
  LoopSeconds loop_seconds() const { return closure_ ? closure_->seconds() : LoopSeconds{}; }
  double averaging_seconds() const { return averaging_seconds_; }
  int num_places() const { return closure_ ? closure_->num_places() : 0; }

 private:
  // Turns the newer of two pieces of the view-graph between which no way was known.
  void AlignPieces(const RelativeRotation& loop);
  // Takes the edges; true when they have moved all orientations.
  bool Close(LoopReport& loops);
  void AverageAll();

  RotationalOdometry odometry_;
  AveragingOptions averaging_;
  double min_correction_deg_;
  bool keep_features_;
  int num_threads_;
  std::optional<LoopClosure> closure_;
  OdometryResult result_;
  // Turns the odometry's world into that of the result, once these are two.
  std::optional<Rotation> odometry_from_world_;
  std::pair<FrameId, Rotation> newest_;  // frame, and its orientation as the odometry has it
  // Edges that a handful of matches speaks for.
  std::set<std::pair<FrameId, FrameId>> weak_edges_;
  bool has_loops_ = false;
  FrameId last_averaged_;  // newest frame when all were averaged
  double averaging_seconds_ = 0.0;
};

}  // namespace rotslam
