#pragma once

#include <cstdint>
#include <vector>

#include <opencv2/core.hpp>

#include "rotodom/masks/mask.h"

namespace rotslam {

/// The kinds of static content: parts of the picture that never move.
enum class StaticContentKind {
  kNone,       // nothing stands still, or everything does
  kOnPicture,  // text, drops, dirt, a border: on the lens or the picture, in front of a scene
  kStanding,   // the camera stands, and things move in front of it
  kUndecided,  // one of the two
};

struct StaticContent {
  StaticContentKind kind = StaticContentKind::kNone;
  Mask mask;  // the static parts, of the images' size; empty for kNone and kStanding
};

/// Finds what never moves in the image while the rest does, from frames spread over a sequence.
///
/// Edges of static content lie at the same pixels in every frame. So the mean of the frames' edge
/// maps, each normalised by its surroundings, keeps their full contrast, while the edges of a scene
/// seen by a moving camera average out. Whether the camera itself stands is decided by the parts
/// that change: in front of a standing camera they return to the same background again and again,
/// at every time many of them show it; a moving camera sees none of it again.
///
/// Memory is bounded: reduced images of at most kMaxSamples frames, spread over all frames so far.
class StaticContentFinder {
 public:
  static constexpr int kMaxSamples = 32;

  /// Takes the next frame; keeps some of them.
  /// @param image  8-bit, one or three channels (BGR), always of the same size; empty ones are
  ///               passed over.
  void Add(const cv::Mat& image);

  /// Whether enough frames were kept since the last Find() for another one.
  bool IsDue() const { return static_cast<int>(samples_.size()) >= due_; }

  /// Decides on all frames so far; where there was nothing to mask and few of them are new, as the
  /// last time. kStanding concerns these frames only: a camera that stands may
  /// move later.
  /// @param has_rotated  whether the camera is known to have rotated by some degrees. Otherwise
  ///                     distant parts of the scene stand still, too, so that more evidence is
  ///                     needed; orientations that follow the static content themselves give
  ///                     false.
  /// Cost: about 2 ms per kept frame; next to nothing where few are new.
  StaticContent Find(bool has_rotated);

  /// Whether frames were kept since the last Find().
  bool HasNews() const { return num_new_ > 0; }

  template <class Archive>
  void Transfer(Archive& archive) {
    int width = image_size_.width;
    int height = image_size_.height;
    archive(width, height, num_frames_, stride_, due_, num_new_, last_kind_, had_rotated_);
    image_size_ = cv::Size(width, height);
    auto num_samples = static_cast<int>(samples_.size());
    archive(num_samples);
    if constexpr (Archive::kIsReader) samples_.assign(num_samples > 0 ? num_samples : 0, {});
    for (cv::Mat& sample : samples_) {
      int rows = sample.rows;
      int cols = sample.cols;
      std::vector<std::uint8_t> bytes;
      if (!sample.empty()) bytes.assign(sample.data, sample.data + sample.total());
      archive(rows, cols, bytes);
      sample = rows > 0 && cols > 0 && bytes.size() == static_cast<std::size_t>(rows) * cols
                   ? cv::Mat(rows, cols, CV_8U, bytes.data()).clone()
                   : cv::Mat();
    }
  }

 private:
  bool IsAsLastTime(bool has_rotated) const;
  StaticContent Decide(bool has_rotated) const;

  cv::Size image_size_;
  std::vector<cv::Mat> samples_;  // 8-bit grey, reduced
  int num_frames_ = 0;
  int stride_ = 4;   // of the kept frames
  int due_ = 24;     // samples at which a decision is worth its time
  int num_new_ = 0;  // samples since the last decision
  StaticContentKind last_kind_ = StaticContentKind::kUndecided;  // of the last decision
  bool had_rotated_ = false;
};

}  // namespace rotslam
