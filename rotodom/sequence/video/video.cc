#include "rotodom/sequence/video/video.h"

#include <algorithm>
#include <cstddef>
#include <future>
#include <iomanip>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "rotodom/sequence/video/video_file.h"

namespace rotslam {
namespace {

class VideoSequence : public Sequence {
 public:
  VideoSequence(const Layout& layout, const SequenceOptions& options)
      : Sequence(layout), options_(options), file_(layout.folder, options.fps) {
    place_ = image_folder_ = layout.folder;
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
    if (count > 0 && ahead_.valid()) {
      const std::optional<Ahead> skipped = ahead_.get();
      if (!skipped) return Finish();
      timestamps_s_.push_back(skipped->time_s);
      --count;
    }
    for (int k = 0; k < count; ++k) {
      if (!Advance()) return Finish();
      timestamps_s_.push_back(file_.time_s());
    }
  }

  std::vector<std::filesystem::path> Files() const override { return {place_}; }

 private:
  // A frame, decoded while the caller works on the one before.
  struct Ahead {
    double time_s = 0.0;
    int number = 0;
    DecodedImage decoded;
  };

  // Steps to the next frame of the file; false after the last.
  bool Grab() {
    if (!file_.Grab()) return false;
    ++number_;
    return true;
  }

  // Steps to the next frame to give; false after the last. The first one is there from the start.
  bool Advance() {
    if (std::exchange(is_at_first_, false)) return true;
    const bool beyond_last = options_.last >= 0 && number_ - 1 > options_.last - options_.stride;
    if (ended_ || beyond_last) return false;
    for (int k = 0; k < options_.stride && !ended_; ++k) ended_ = !Grab();
    return !ended_;
  }

  std::optional<Ahead> ReadOne() {
    if (!Advance()) return std::nullopt;
    return Ahead{file_.time_s(), number_ - 1, file_.Retrieve()};
  }

  void Finish() {
    has_finished_ = true;
    num_frames_ = static_cast<int>(timestamps_s_.size());
    for (; num_file_notes_ < file_.notes().size(); ++num_file_notes_) {
      notes_.push_back(file_.notes()[num_file_notes_]);
    }
  }

  std::optional<Frame> Decode() override {
    if (has_finished_) return std::nullopt;
    std::optional<Ahead> read = ahead_.valid() ? ahead_.get() : ReadOne();
    if (!read) {
      Finish();
      return std::nullopt;
    }
    ahead_ = std::async(std::launch::async, [this] { return ReadOne(); });
    Frame frame;
    frame.id = FrameId{static_cast<int>(timestamps_s_.size())};
    frame.timestamp_s = read->time_s;
    std::ostringstream name;
    name << std::setw(6) << std::setfill('0') << read->number;
    frame.name = name.str();
    timestamps_s_.push_back(read->time_s);
    frame.image = std::move(read->decoded.image);
    frame.problem = std::move(read->decoded.problem);
    return frame;
  }

  SequenceOptions options_;
  VideoFile file_;
  std::size_t num_file_notes_ = file_.notes().size();  // those that are among notes_
  bool is_at_first_ = true;
  bool ended_ = false;         // the file has no more frames
  bool has_finished_ = false;  // and the caller knows
  int number_ = 0;             // frames of the file grabbed so far
  // Touches all that is above; last, so that it is waited for first.
  std::future<std::optional<Ahead>> ahead_;
};

}  // namespace

std::unique_ptr<Sequence> OpenVideo(const Layout& layout, const SequenceOptions& options) {
  return std::make_unique<VideoSequence>(layout, options);
}

}  // namespace rotslam
