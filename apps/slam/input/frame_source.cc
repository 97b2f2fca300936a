#include "apps/slam/input/frame_source.h"

#include <algorithm>
#include <exception>
#include <utility>

namespace rotslam {

SequenceSource::SequenceSource(std::filesystem::path path, const SequenceOptions& options)
    : path_(std::move(path)), options_(options), sequence_(OpenSequence(path_, options_)) {}

void SequenceSource::Read(const std::set<FrameId>& frames,
                          const std::function<void(FrameId, const cv::Mat&)>& take,
                          const std::function<void(const std::string&)>& tell) {
  try {
    const std::unique_ptr<Sequence> sequence = OpenSequence(path_, options_);
    int next = 0;
    for (const FrameId wanted : frames) {
      sequence->Skip(wanted.value - next);
      next = wanted.value + 1;
      const std::optional<Frame> frame = sequence->Next();
      if (!frame) {
        tell(path_.string() + ": ends before frame " + std::to_string(wanted.value));
        return;
      }
      if (frame->image.empty()) {
        tell(path_.string() + ": " + frame->name + ": " + frame->problem);
        continue;
      }
      take(wanted, frame->image);
    }
  } catch (const std::exception& error) {
    tell(error.what());
  }
}

std::optional<Frame> FirstFrames::Next() {
  if (num_taken_ == max_frames_) return std::nullopt;
  ++num_taken_;
  return frames_.Next();
}

void FirstFrames::Skip(int count) {
  count = std::min(count, max_frames_ - num_taken_);
  num_taken_ += count;
  frames_.Skip(count);
}

void FirstFrames::Rewind() {
  num_taken_ = 0;
  frames_.Rewind();
}

int FirstFrames::NumFrames() const {
  const int num_frames = frames_.NumFrames();
  return num_frames < 0 ? num_frames : std::min(num_frames, max_frames_);
}

std::optional<Frame> ReducedFrames::Next() {
  std::optional<Frame> frame = frames_.Next();
  if (frame) frame->image = working_.Reduced(frame->image);
  return frame;
}

void ReducedFrames::Read(const std::set<FrameId>& frames,
                         const std::function<void(FrameId, const cv::Mat&)>& take,
                         const std::function<void(const std::string&)>& tell) {
  frames_.Read(
      frames,
      [&](FrameId frame, const cv::Mat& image) { take(frame, working_.Reduced(image)); },
      tell);
}

}  // namespace rotslam
