#include "rotodom/sequence/frame_thumbnail.h"

#include <algorithm>

#include <opencv2/imgproc.hpp>

namespace rotslam {

FrameThumbnail MakeFrameThumbnail(const cv::Mat& image) {
  if (image.empty()) return {};
  // Rows enough for ten per value: reading all of a large image takes longer and tells no more.
  constexpr int kRowsRead = 240;
  const int step = std::max(1, image.rows / kRowsRead);
  const cv::Mat rows(image.rows / step, image.cols, image.type(), image.data, image.step[0] * step);
  cv::Mat small;
  cv::resize(rows, small, {kThumbnailWidth, kThumbnailHeight}, 0.0, 0.0, cv::INTER_AREA);
  if (small.channels() == 3) cv::cvtColor(small, small, cv::COLOR_BGR2GRAY);
  return {small.begin<std::uint8_t>(), small.end<std::uint8_t>()};
}

}  // namespace rotslam
