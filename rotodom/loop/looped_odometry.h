#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <opencv2/core.hpp>

#include "rotodom/loop/loop_closure.h"
#include "rotodom/loop/looped_orientations.h"
#include "rotodom/odometry.h"
#include "rotodom/rolling_shutter/readout.h"

namespace rotslam {

/// What one frame brought, loops included.
struct LoopedEstimate {
  FrameId frame;
  Rotation cam_from_world;
  // As in FrameEstimate: of the odometry, which loops can only make smaller.
  std::optional<Eigen::Matrix3d> covariance;
  FrameReport report;
  SeenPoints points;             // of a replayed frame only where its record has features
  std::vector<LoopCheck> loops;  // what the frame before looked like
  bool has_averaged = false;     // orientations of older frames have moved as a loop says
};

struct FrameRecord;

/// Rotational odometry that notices when the camera is back, and then spreads the drift over all
/// orientations (LoopedOrientations). The odometry itself goes on undisturbed; its orientations are
/// turned into the world that the last averaging left. What is remembered grows with the sequence.
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
  /// @param record  when given, receives what Replay needs.
  LoopedEstimate AddFrame(FrameId frame,
                          double timestamp_s,
                          const cv::Mat& image,
                          FrameRecord* record = nullptr);

  /// To go on where another one stood that was made with the same arguments (but for the number of
  /// threads) by the same program: takes all its frames, by their records, and then the state of
  /// its odometry after the last of them, as RotationalOdometry::SaveState() and RestoreState().
  /// What follows is the same to the last bit.
  LoopedEstimate Replay(FrameRecord record);
  std::string SaveState() { return odometry_.SaveState(); }
  void RestoreState(std::string_view state) { odometry_.RestoreState(state); }

  /// To be called after the last frame: averages once more when there were loops, and completes
  /// the covariances. What the last frame looked like.
  std::vector<LoopCheck> Finish();

  /// All frames so far.
  const OdometryResult& result() const { return orientations_.result(); }
  OdometryResult&& TakeResult() { return orientations_.TakeResult(); }

  double exposure_s() const { return odometry_.exposure_s(); }
  const OdometrySeconds& odometry_seconds() const { return odometry_.seconds(); }
  LoopSeconds loop_seconds() const { return closure_ ? closure_->seconds() : LoopSeconds{}; }
  double averaging_seconds() const { return orientations_.averaging_seconds(); }
  std::map<FrameId, Features> TakePlaces() {
    return closure_ ? closure_->TakePlaces() : std::map<FrameId, Features>();
  }
  int num_places() const { return closure_ ? closure_->num_places() : 0; }

 private:
  LoopedEstimate Take(FrameEstimate estimate, LoopReport loops);

  RotationalOdometry odometry_;
  int window_;
  bool keep_features_;
  std::optional<LoopClosure> closure_;
  LoopedOrientations orientations_;
};

}  // namespace rotslam
