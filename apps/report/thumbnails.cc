#include "apps/report/thumbnails.h"

#include <algorithm>
#include <cstdint>
#include <exception>
#include <filesystem>
#include <limits>
#include <memory>
#include <optional>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "apps/report/run_summary.h"
#include "rotodom/sequence/sequence.h"

namespace rotslam {
namespace {

std::string SmallJpeg(const cv::Mat& image, const ThumbnailOptions& options) {
  const double scale =
      std::min(1.0, static_cast<double>(options.size_px) / std::max(image.cols, image.rows));
  cv::Mat small;
  cv::resize(image, small, {}, scale, scale, cv::INTER_AREA);
  std::vector<unsigned char> bytes;
  cv::imencode(".jpg", small, bytes, {cv::IMWRITE_JPEG_QUALITY, options.jpeg_quality});
  return {bytes.begin(), bytes.end()};
}

}  // namespace

Thumbnails MakeThumbnails(const RunData& run,
                          const std::string& sequence,
                          const ThumbnailOptions& options) {
  Thumbnails thumbnails;
  if (options.max_count <= 0) {
    thumbnails.problem = "images were left out";
    return thumbnails;
  }
  std::string place = sequence;
  try {
    if (place.empty()) place = run.summary.at("sequence").at("path");
    if (!std::filesystem::exists(place)) {
      thumbnails.problem = "the images are no longer at " + place;
      return thumbnails;
    }
    SequenceOptions frames = SequenceOptionsOf(run.summary);
    // Of a folder only the frames that are shown are decoded.
    const int step = (run.NumFrames() + options.max_count - 1) / options.max_count;
    frames.stride = static_cast<int>(std::min<std::int64_t>(std::int64_t{frames.stride} * step,
                                                            std::numeric_limits<int>::max()));
    const std::unique_ptr<Sequence> images = OpenSequence(place, frames);
    while (const std::optional<Frame> frame = images->Next()) {
      if (frame->image.empty() || frame->id.value * step >= run.NumFrames()) continue;
      thumbnails.frames.push_back(frame->id.value * step);
      thumbnails.jpegs.push_back(SmallJpeg(frame->image, options));
    }
  } catch (const std::exception& error) {
    thumbnails = {{}, {}, std::string("the images cannot be read: ") + error.what()};
  }
  if (thumbnails.frames.empty() && thumbnails.problem.empty()) {
    thumbnails.problem = "no image at " + place + " could be read";
  }
  return thumbnails;
}

}  // namespace rotslam
