#pragma once

#include <algorithm>
#include <functional>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "apps/simulation/simulation.h"
#include "apps/slam/input/frame_source.h"

namespace rotslam {

/// Images in memory as a source of frames. An empty image counts as unreadable.
class ImageSource : public FrameSource {
 public:
  explicit ImageSource(const SimulatedSequence& sequence) {
    for (std::size_t k = 0; k < sequence.images.size(); ++k) {
      Frame frame;
      frame.id = FrameId{static_cast<int>(k)};
      frame.timestamp_s = sequence.truth[k].timestamp_s;
      frame.image = sequence.images[k];
      frame.name = std::to_string(k);
      if (frame.image.empty()) frame.problem = "empty";
      frames_.push_back(frame);
    }
  }

  std::optional<Frame> Next() override {
    return next_ < NumFrames() ? std::optional(frames_[next_++]) : std::nullopt;
  }
  void Skip(int count) override { next_ = std::min(next_ + count, NumFrames()); }
  void Rewind() override { next_ = 0; }
  int NumFrames() const override { return static_cast<int>(frames_.size()); }
  void Read(const std::set<FrameId>& frames,
            const std::function<void(FrameId frame, const cv::Mat& image)>& take,
            const std::function<void(const std::string& problem)>& /*tell*/) override {
    for (const FrameId frame : frames) take(frame, frames_[frame.value].image);
  }

  int next() const { return next_; }

 private:
  std::vector<Frame> frames_;
  int next_ = 0;
};

/// A walk through a room, 320 x 240 pixels.
inline SimulatedSequence RenderWalk(int num_frames) {
  SimulationOptions options;
  options.kind = SimulationKind::kHandheld;
  options.frames = num_frames;
  options.camera = CameraWithView(320, 240, 65.0);
  options.camera.knows_readout = true;
  return RenderSequence(options, /*num_threads=*/2);
}

}  // namespace rotslam
