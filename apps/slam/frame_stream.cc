#include "apps/slam/frame_stream.h"

#include <utility>

namespace rotslam {

FrameStream::FrameStream(FrameSource& frames, LoopedOdometry& odometry, FrameLog* log)
    : frames_(frames), odometry_(odometry), log_(log), is_replaying_(log != nullptr) {}

std::optional<FrameStream::Step> FrameStream::Next(bool needs_points) {
  if (is_replaying_) {
    if (std::optional<RecordedFrame> recorded = log_->NextRecorded()) {
      ++num_recorded_;
      LoopedEstimate estimate = odometry_.Replay(std::move(recorded->record));
      estimate.points = std::move(recorded->points);
      return Step{std::move(recorded->frame), std::move(estimate)};
    }
    is_replaying_ = false;
    if (num_recorded_ > 0) {
      log_->Restore(odometry_);
      frames_.Skip(num_recorded_);
    }
  }
  std::optional<Frame> frame = frames_.Next();
  if (!frame) return std::nullopt;
  const bool records = log_ != nullptr && log_->IsOn();
  RecordedFrame recorded;
  Step step;
  step.estimate = odometry_.AddFrame(
      frame->id, frame->timestamp_s, frame->image, records ? &recorded.record : nullptr);
  frame->image.release();
  step.frame = *std::move(frame);
  if (!records) return step;
  recorded.frame = step.frame;
  if (needs_points) recorded.points = step.estimate.points;
  log_->Append(recorded);
  if (log_->IsDue()) Commit();
  return step;
}

void FrameStream::Commit() {
  if (log_ != nullptr && log_->IsOn()) log_->Commit(odometry_.SaveState());
}

}  // namespace rotslam
