#pragma once

#include <optional>
#include <string>

#include "rotodom/loop/frame_record.h"
#include "rotodom/loop/looped_odometry.h"
#include "rotodom/rolling_shutter/readout.h"
#include "rotodom/sequence/sequence.h"

namespace rotslam {

/// What the odometry found for one frame; the image is not stored.
struct RecordedFrame {
  Frame frame;
  FrameRecord record;
  SeenPoints points;  // empty where the readout is known

  template <class Archive>
  void Transfer(Archive& archive) {
    archive(frame.id, frame.timestamp_s, frame.name, frame.problem, record, points);
  }
};

/// Stores the frames of the first stage one by one, so that an interrupted run can be resumed.
class FrameLog {
 public:
  virtual ~FrameLog() = default;

  /// The next frame of the interrupted run; nullopt after the last. Throws std::runtime_error where
  /// the log is damaged.
  virtual std::optional<RecordedFrame> NextRecorded() = 0;
  /// Restores the state of the odometry after the last recorded frame.
  virtual void Restore(LoopedOdometry& odometry) const = 0;

  /// The readout of the camera, where the interrupted run had estimated it from the images.
  virtual const std::optional<ReadoutEstimate>& readout() const = 0;
  /// Removes all frames; tracking starts again from the first frame with this readout.
  virtual void StartOver(const ReadoutEstimate& readout) = 0;

  /// Whether frames are to be appended.
  virtual bool IsOn() const = 0;
  virtual void Append(RecordedFrame& frame) = 0;
  /// Whether enough frames were appended since the last Commit() to call it again.
  virtual bool IsDue() const = 0;
  /// @param state  the odometry's, after the frame appended last.
  virtual void Commit(std::string state) = 0;
};

}  // namespace rotslam
