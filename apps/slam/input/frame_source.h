#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <string>

#include <opencv2/core.hpp>

#include "apps/slam/working_size/working_size.h"
#include "rotodom/sequence/sequence.h"
#include "rotodom/types/ids.h"

namespace rotslam {

/// Gives images of frames that were tracked before to the stages that need them again.
class ImageProvider {
 public:
  virtual ~ImageProvider() = default;

  /// Calls `take` with the image of each of `frames`, ids ascending. An image that cannot be read
  /// is left out; `tell` then gets one line with the reason.
  virtual void Read(const std::set<FrameId>& frames,
                    const std::function<void(FrameId frame, const cv::Mat& image)>& take,
                    const std::function<void(const std::string& problem)>& tell) = 0;
};

/// Frames in their order, ids from 0 without gaps, timestamps increasing.
class FrameSource : public ImageProvider {
 public:
  /// The next frame; nullopt after the last. An image that cannot be decoded comes as an empty one
  /// with `problem` set.
  virtual std::optional<Frame> Next() = 0;
  /// Passes over `count` frames, or those that are left.
  virtual void Skip(int count) = 0;
  /// The next frame is the first one again.
  virtual void Rewind() = 0;
  /// Number of frames of the sequence; negative where it is not known.
  virtual int NumFrames() const = 0;
};

/// The frames of a sequence on disk (OpenSequence). Read() opens the sequence a second time, so
/// that the position of Next() does not change.
class SequenceSource : public FrameSource {
 public:
  /// Throws as OpenSequence does.
  SequenceSource(std::filesystem::path path, const SequenceOptions& options);

  const Sequence& sequence() const { return *sequence_; }
  const std::filesystem::path& path() const { return path_; }

  std::optional<Frame> Next() override { return sequence_->Next(); }
  void Skip(int count) override { sequence_->Skip(count); }
  void Rewind() override { sequence_ = OpenSequence(path_, options_); }
  int NumFrames() const override { return sequence_->NumFrames(); }
  void Read(const std::set<FrameId>& frames,
            const std::function<void(FrameId frame, const cv::Mat& image)>& take,
            const std::function<void(const std::string& problem)>& tell) override;

 private:
  std::filesystem::path path_;
  SequenceOptions options_;
  std::unique_ptr<Sequence> sequence_;
};

/// The first `max_frames` frames of another source, which must outlive it.
class FirstFrames : public FrameSource {
 public:
  FirstFrames(FrameSource& frames, int max_frames) : frames_(frames), max_frames_(max_frames) {}

  std::optional<Frame> Next() override;
  void Skip(int count) override;
  void Rewind() override;
  int NumFrames() const override;
  void Read(const std::set<FrameId>& frames,
            const std::function<void(FrameId frame, const cv::Mat& image)>& take,
            const std::function<void(const std::string& problem)>& tell) override {
    frames_.Read(frames, take, tell);
  }

 private:
  FrameSource& frames_;
  int max_frames_;
  int num_taken_ = 0;
};

/// The frames of another source, which must outlive it, at the size they are worked with. An image
/// of another size than the others throws std::invalid_argument.
class ReducedFrames : public FrameSource {
 public:
  ReducedFrames(FrameSource& frames, const WorkingSize& working)
      : frames_(frames), working_(working) {}

  std::optional<Frame> Next() override;
  void Skip(int count) override { frames_.Skip(count); }
  void Rewind() override { frames_.Rewind(); }
  int NumFrames() const override { return frames_.NumFrames(); }
  void Read(const std::set<FrameId>& frames,
            const std::function<void(FrameId frame, const cv::Mat& image)>& take,
            const std::function<void(const std::string& problem)>& tell) override;

 private:
  FrameSource& frames_;
  WorkingSize working_;
};

}  // namespace rotslam
