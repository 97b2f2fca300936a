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

/// The result of one frame, including loops.
struct LoopedEstimate {
  FrameId frame;
  Rotation cam_from_world;
  // Covariance of the odometry, as in FrameEstimate; loops can only make it smaller.
  std::optional<Eigen::Matrix3d> covariance;
  FrameReport report;
  SeenPoints points;             // of a replayed frame only if its record has features
  std::vector<LoopCheck> loops;  // loop candidates of the frame before
  bool has_averaged = false;     // a loop has changed orientations of older frames
};

struct LoopedOdometryOptions {
  OdometryOptions odometry = {};
  LoopOptions loops = {};
  std::shared_ptr<const Vocabulary> vocabulary = nullptr;  // null: DefaultVocabulary
  bool keep_features = true;                               // for tracks
  std::uint64_t seed = 1;
  int num_threads = 1;
};

struct FrameRecord;

/// Rotational odometry with loop closure: loops distribute the drift over all orientations
/// (LoopedOrientations). The odometry itself is not affected; its orientations are transformed into
/// the world of the last averaging. Memory grows with the sequence.
class LoopedOdometry {
 public:
  /// Throws std::invalid_argument when an option or the camera is out of range.
  LoopedOdometry(const Camera& camera, const LoopedOdometryOptions& options);

  /// Adds the next frame, as RotationalOdometry::AddFrame.
  /// @param record  when set, receives the input of Replay.
  LoopedEstimate AddFrame(FrameId frame,
                          double timestamp_s,
                          const MaskedImage& image,
                          FrameRecord* record = nullptr);

  /// Restores the state of another object that was constructed with the same arguments (the number
  /// of threads may differ) by the same program: replay all frames from their records, then restore
  /// the state of the odometry after the last of them. Subsequent results are identical to the last
  /// bit.
  LoopedEstimate Replay(FrameRecord record);
  std::string SaveState() { return odometry_.SaveState(); }
  void RestoreState(std::string_view state) { odometry_.RestoreState(state); }

  /// Call after the last frame: averages once more when there were loops, and completes the
  /// covariances. Returns the loop candidates of the last frame.
  std::vector<LoopCheck> Finish();

  /// Whether a loop is about to change orientations of older frames.
  bool is_averaging() const { return orientations_.is_averaging(); }
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
