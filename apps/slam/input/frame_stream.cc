#include "apps/slam/input/frame_stream.h"

#include <utility>

namespace rotslam {

TrackedFrame TrackFrame(Frame frame,
                        const FrameMasks& masks,
                        const TrackingTools& tools,
                        FrameRecord* record) {
  TrackedFrame tracked;
  tools.static_content.Add(frame.image);
  const Mask mask = frame.image.empty() ? Mask() : masks.Of(frame.name);
  tracked.estimate =
      tools.odometry.AddFrame(frame.id, frame.timestamp_s, {frame.image, mask}, record);
  tracked.thumbnail = MakeFrameThumbnail(frame.image);
  frame.image.release();
  tracked.frame = std::move(frame);
  return tracked;
}

std::optional<TrackedFrame> FrameStream::Next(bool needs_points) {
  if (is_replaying_) {
    if (std::optional<RecordedFrame> recorded = log_->NextRecorded()) {
      ++num_recorded_;
      LoopedEstimate estimate = tools_.odometry.Replay(std::move(recorded->record));
      estimate.points = std::move(recorded->points);
      return TrackedFrame{
          std::move(recorded->frame), std::move(recorded->thumbnail), std::move(estimate)};
    }
    is_replaying_ = false;
    if (num_recorded_ > 0) {
      log_->Restore([this](const TrackingState& state) {
        tools_.odometry.RestoreState(state.odometry);
        tools_.static_content.RestoreState(state.static_content);
      });
      frames_.Skip(num_recorded_);
    }
  }
  std::optional<Frame> frame = frames_.Next();
  if (!frame) return std::nullopt;
  const bool records = log_ != nullptr && log_->IsOn();
  RecordedFrame recorded;
  TrackedFrame tracked =
      TrackFrame(*std::move(frame), masks_, tools_, records ? &recorded.record : nullptr);
  if (!records) return tracked;
  recorded.frame = tracked.frame;
  recorded.thumbnail = tracked.thumbnail;
  if (needs_points) recorded.points = tracked.estimate.points;
  log_->Append(recorded);
  if (log_->IsDue()) Commit();
  return tracked;
}

void FrameStream::Commit() {
  if (log_ != nullptr && log_->IsOn()) {
    log_->Commit({tools_.odometry.SaveState(), tools_.static_content.SaveState()});
  }
}

}  // namespace rotslam
