#include "rotodom/sequence/video.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <iomanip>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "rotodom/sequence/video_file.h"

namespace rotslam {
namespace {

class VideoSequence : public Sequence {
 public:
  VideoSequence(Layout layout, const SequenceOptions& options)
      : Sequence(layout), options_(options), file_(layout.folder, options.fps) {
    place_ = image_folder_ = std::move(layout.folder);
    form_ = file_.form();
    times_source_ = file_.times_source();
    times_are_made_up_ = file_.times_are_made_up();
    notes_ = file_.notes();
    readout_from_ = file_.readout_from();
    metadata_ = file_.metadata();
    image_size_ = file_.image_size();
    while (number_ <= options.first) {
      if (Grab()) continue;
      throw std::runtime_error(place_.string() + ": first frame " + std::to_string(options.first) +
                               " asked for, but there are only " + std::to_string(number_));
    }
    if (file_.num_announced() > 0) {
      int last = static_cast<int>(file_.num_announced()) - 1;
      if (options.last >= 0) last = std::min(last, options.last);
      num_frames_ = std::max(0, last - options.first) / options.stride + 1;
    }
  }

  void Skip(int count) override {
    for (int k = 0; k < count && Advance(); ++k) timestamps_s_.push_back(file_.time_s());
  }

  std::vector<std::filesystem::path> Files() const override { return {place_}; }

 private:
  // Steps to the next frame of the file; false after the last.
  bool Grab() {
    if (file_.Grab()) {
      ++number_;
      return true;
    }
    for (std::size_t k = num_file_notes_; k < file_.notes().size(); ++k) {
      notes_.push_back(file_.notes()[k]);
    }
    num_file_notes_ = file_.notes().size();
    return false;
  }

  // Steps to the next frame to give; false after the last. The first one is there from the start.
  bool Advance() {
    if (timestamps_s_.empty()) return true;
    const bool beyond_last = options_.last >= 0 && number_ - 1 > options_.last - options_.stride;
    if (ended_ || beyond_last) return false;
    for (int k = 0; k < options_.stride && !ended_; ++k) ended_ = !Grab();
    return !ended_;
  }

  std::optional<Frame> Decode() override {
    if (!Advance()) {
      num_frames_ = static_cast<int>(timestamps_s_.size());
      return std::nullopt;
    }
    Frame frame;
    frame.id = FrameId{static_cast<int>(timestamps_s_.size())};
    frame.timestamp_s = file_.time_s();
    std::ostringstream name;
    name << std::setw(6) << std::setfill('0') << number_ - 1;
    frame.name = name.str();
    timestamps_s_.push_back(frame.timestamp_s);
    DecodedImage decoded = file_.Retrieve();
    frame.image = std::move(decoded.image);
    frame.problem = std::move(decoded.problem);
    return frame;
  }

  SequenceOptions options_;
  VideoFile file_;
  std::size_t num_file_notes_ = file_.notes().size();  // those that are among notes_
  bool ended_ = false;
  int number_ = 0;  // frames of the file grabbed so far
};

}  // namespace

std::unique_ptr<Sequence> OpenVideo(Layout layout, const SequenceOptions& options) {
  return std::make_unique<VideoSequence>(std::move(layout), options);
}

}  // namespace rotslam
