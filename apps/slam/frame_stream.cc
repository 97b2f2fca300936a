#include "apps/slam/frame_stream.h"

#include <utility>

namespace rotslam {

FrameStream::FrameStream(Sequence& sequence, LoopedOdometry& odometry, Checkpoint* checkpoint)
    : sequence_(sequence),
      odometry_(odometry),
      checkpoint_(checkpoint),
      is_replaying_(checkpoint != nullptr) {}

std::optional<FrameStream::Step> FrameStream::Next(bool needs_points) {
  if (is_replaying_) {
    if (std::optional<RecordedFrame> recorded = checkpoint_->NextRecorded()) {
      ++num_recorded_;
      LoopedEstimate estimate = odometry_.Replay(std::move(recorded->record));
      estimate.points = std::move(recorded->points);
      return Step{std::move(recorded->frame), std::move(estimate)};
    }
    is_replaying_ = false;
    if (num_recorded_ > 0) {
      checkpoint_->Restore(odometry_);
      sequence_.Skip(num_recorded_);
    }
  }
  std::optional<Frame> frame = sequence_.Next();
  if (!frame) return std::nullopt;
  const bool records = checkpoint_ != nullptr && checkpoint_->IsOn();
  RecordedFrame recorded;
  Step step;
  step.estimate = odometry_.AddFrame(
      frame->id, frame->timestamp_s, frame->image, records ? &recorded.record : nullptr);
  frame->image.release();
  step.frame = *std::move(frame);
  if (!records) return step;
  recorded.frame = step.frame;
  if (needs_points) recorded.points = step.estimate.points;
  checkpoint_->Append(recorded);
  if (checkpoint_->IsDue()) Commit();
  return step;
}

void FrameStream::Commit() {
  if (checkpoint_ != nullptr && checkpoint_->IsOn()) checkpoint_->Commit(odometry_.SaveState());
}

}  // namespace rotslam
