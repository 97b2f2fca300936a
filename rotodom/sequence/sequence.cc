#include "rotodom/sequence/sequence.h"

#include <algorithm>
#include <cstdint>
#include <future>
#include <stdexcept>
#include <utility>

#include <opencv2/core.hpp>

#include "rotodom/sequence/image_file.h"
#include "rotodom/sequence/layout.h"
#include "rotodom/sequence/sequence_form.h"
#include "rotodom/types/text_file.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void FailBeyondEnd(const fs::path& place, int first, int num_frames) {
  throw std::runtime_error(place.string() + ": first frame " + std::to_string(first) +
                           " asked for, but there are only " + std::to_string(num_frames));
}

void CheckIncreasing(const std::vector<ImageEntry>& entries, const fs::path& time_list) {
  for (std::size_t k = 1; k < entries.size(); ++k) {
    const ImageEntry& before = entries[k - 1];
    const ImageEntry& entry = entries[k];
    if (entry.timestamp_s > before.timestamp_s) continue;
    const bool is_listed = entry.line > 0 && before.line > 0;
    const std::string reason = "timestamp " + FormatNumber("%.9f", entry.timestamp_s) +
                               " s is not later than the " +
                               FormatNumber("%.9f", before.timestamp_s) +
                               " s of the frame before it, " + before.file.filename().string();
    if (!is_listed) throw std::runtime_error(entry.file.string() + ": " + reason);
    throw std::runtime_error(AtLine(time_list,
                                    entry.line,
                                    entry.file.filename().string() + ": " + reason + " in line " +
                                        std::to_string(before.line) +
                                        "; sort the lines by time, and give each once"));
  }
}

class FileSequence : public Sequence {
 public:
  FileSequence(Layout layout, const SequenceOptions& options) : Sequence(layout) {
    place_ = std::move(layout.folder);
    const int num_entries = static_cast<int>(layout.entries.size());
    for (const ImageEntry& entry : layout.entries) all_files_.push_back(entry.file);
    if (options.first >= num_entries) FailBeyondEnd(place_, options.first, num_entries);
    const bool to_the_end = options.last < 0 || options.last >= num_entries;
    const int end = to_the_end ? num_entries : options.last + 1;
    for (std::int64_t k = options.first; k < end; k += options.stride) {
      entries_.push_back(std::move(layout.entries[static_cast<std::size_t>(k)]));
      timestamps_s_.push_back(entries_.back().timestamp_s);
    }
    image_folder_ = entries_.front().file.parent_path();
    num_frames_ = static_cast<int>(entries_.size());
    CheckIncreasing(entries_, layout.time_list);
    FindImageSize();
    if (layout.photometric) photometric_.emplace(*layout.photometric, image_size_);
  }

  void Skip(int count) override {
    ahead_ = {};
    next_ += std::min(count, num_frames_ - next_);
  }

  std::vector<fs::path> Files() const override {
    std::vector<fs::path> files;
    files.reserve(entries_.size());
    for (const ImageEntry& entry : entries_) files.push_back(entry.file);
    return files;
  }

 private:
  // Size and pixels of the first image that can be read.
  void FindImageSize() {
    std::string first_problem;
    for (const ImageEntry& entry : entries_) {
      const DecodedImage decoded = DecodeImageFile(entry.file);
      if (!decoded.image.empty()) {
        image_size_ = decoded.image.size();
        if (decoded.image.depth() != CV_8U) FindScale(decoded.image.depth());
        return;
      }
      if (first_problem.empty()) first_problem = decoded.problem;
    }
    throw std::runtime_error(place_.string() + ": none of the " + std::to_string(num_frames_) +
                             " images can be read; " + entries_.front().file.filename().string() +
                             ": " + first_problem);
  }

  // From images all over the sequence, as the first ones may be dark.
  void FindScale(int depth) {
    constexpr std::size_t kNumImages = 8;
    std::vector<cv::Mat> images;
    const std::size_t last = all_files_.size() - 1;
    for (std::size_t k = 0; k < kNumImages; ++k) {
      const std::size_t number = k * last / (kNumImages - 1);
      if (k > 0 && number == (k - 1) * last / (kNumImages - 1)) continue;
      images.push_back(DecodeImageFile(all_files_[number]).image);
    }
    scale_ = FindPixelScale(images);
    if (const auto note = rotslam::Describe(scale_, depth)) notes_.push_back(*note);
  }

  std::optional<Frame> Decode() override {
    if (next_ == num_frames_) return std::nullopt;
    const ImageEntry& entry = entries_[next_];
    Frame frame;
    frame.id = FrameId{next_++};
    frame.timestamp_s = entry.timestamp_s;
    frame.name = entry.file.filename().string();
    DecodedImage decoded = ahead_.valid() ? ahead_.get() : ReadImageFile(entry.file, scale_);
    if (next_ < num_frames_) {
      ahead_ = std::async(std::launch::async, [file = entries_[next_].file, scale = scale_] {
        return ReadImageFile(file, scale);
      });
    }
    frame.image = std::move(decoded.image);
    frame.problem = std::move(decoded.problem);
    // An image of another size is refused by Next().
    if (photometric_ && frame.image.size() == image_size_) photometric_->Apply(frame.image);
    return frame;
  }

  std::vector<ImageEntry> entries_;
  std::vector<fs::path> all_files_;  // also those that first, last and stride leave out
  PixelScale scale_;
  std::optional<PhotometricCorrection> photometric_;
  int next_ = 0;
  // Image next_, decoded while the caller works on the one before.
  std::future<DecodedImage> ahead_;
};

}  // namespace

std::unique_ptr<Sequence> OpenSequence(const fs::path& path, const SequenceOptions& options) {
  if (const auto problem = options.Problem()) {
    throw std::invalid_argument("sequence options: " + *problem);
  }
  const SequenceForm& form = FindSequenceForm(path);
  Layout layout = FindLayout(path, options);
  if (form.open != nullptr) return form.open(layout, options);
  return std::make_unique<FileSequence>(std::move(layout), options);
}

}  // namespace rotslam
