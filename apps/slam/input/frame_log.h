#pragma once

#include <functional>
#include <optional>
#include <string>

#include "rotodom/loop/frame_record.h"
#include "rotodom/masks/static_content.h"
#include "rotodom/rolling_shutter/readout.h"
#include "rotodom/sequence/frame_thumbnail.h"
#include "rotodom/sequence/sequence.h"

namespace rotslam {

/// The result of the odometry for one frame, without the image.
struct RecordedFrame {
  Frame frame;
  FrameThumbnail thumbnail;
  FrameRecord record;
  SeenPoints points;  // empty where the readout is known

  template <class Archive>
  void Transfer(Archive& archive) {
    archive(frame.id, frame.timestamp_s, frame.name, frame.problem, thumbnail, record, points);
  }
};

/// Properties of the camera that were found in the images, each of which made tracking start again.
struct FoundInImages {
  std::optional<ReadoutEstimate> readout;
  StaticContent static_content;

  template <class Archive>
  void Transfer(Archive& archive) {
    archive(readout, static_content.kind, static_content.mask);
  }
};

/// The states of the first stage after a frame, as bytes.
struct TrackingState {
  std::string odometry;
  std::string static_content;

  template <class Archive>
  void Transfer(Archive& archive) {
    archive(odometry, static_content);
  }
};

/// Stores the frames of the first stage one by one, so that an interrupted run can be resumed.
class FrameLog {
 public:
  virtual ~FrameLog() = default;

  /// The next frame of the interrupted run; nullopt after the last. Throws std::runtime_error where
  /// the log is damaged.
  virtual std::optional<RecordedFrame> NextRecorded() = 0;
  /// Calls `restore` with the state after the last recorded frame. Throws std::runtime_error where
  /// `restore` does.
  virtual void Restore(const std::function<void(const TrackingState&)>& restore) const = 0;

  /// The properties that the interrupted run had found in the images.
  virtual const FoundInImages& found() const = 0;
  /// Removes all frames; tracking starts again from the first frame with what was found.
  virtual void StartOver(const FoundInImages& found) = 0;

  /// Whether frames are to be appended.
  virtual bool IsOn() const = 0;
  virtual void Append(RecordedFrame& frame) = 0;
  /// Whether enough frames were appended since the last Commit() to call it again.
  virtual bool IsDue() const = 0;
  /// @param state  after the frame appended last.
  virtual void Commit(TrackingState state) = 0;
};

}  // namespace rotslam
