#pragma once

#include <optional>
#include <string>

#include "rotodom/loop/frame_record.h"
#include "rotodom/loop/looped_odometry.h"
#include "rotodom/rolling_shutter/readout.h"
#include "rotodom/sequence/sequence.h"

namespace rotslam {

/// One frame as it was tracked, without its image.
struct RecordedFrame {
  Frame frame;
  FrameRecord record;
  SeenPoints points;  // empty where the readout is known

  template <class Archive>
  void Transfer(Archive& archive) {
    archive(frame.id, frame.timestamp_s, frame.name, frame.problem, record, points);
  }
};

/// Keeps the first stage's frames as they come, so that a run that was killed goes on from them.
class FrameLog {
 public:
  virtual ~FrameLog() = default;

  /// The frames of the interrupted run, one by one; nullopt after the last. Throws
  /// std::runtime_error where they are damaged.
  virtual std::optional<RecordedFrame> NextRecorded() = 0;
  /// Gives the odometry the state that it had after them.
  virtual void Restore(LoopedOdometry& odometry) const = 0;

  /// The camera's readout, where the interrupted run had found it from the images.
  virtual const std::optional<ReadoutEstimate>& readout() const = 0;
  /// Removes all frames: the sequence is tracked once more with this readout.
  virtual void StartOver(const ReadoutEstimate& readout) = 0;

  /// Whether frames are to be appended.
  virtual bool IsOn() const = 0;
  virtual void Append(RecordedFrame& frame) = 0;
  /// Whether enough frames were appended since the last Commit().
  virtual bool IsDue() const = 0;
  /// @param state  the odometry's, after the frame appended last.
  virtual void Commit(std::string state) = 0;
};

}  // namespace rotslam
