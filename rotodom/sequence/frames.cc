#include "rotodom/sequence/frames.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <iomanip>
#include <sstream>
#include <stdexcept>

namespace rotslam {
namespace {

std::string SizeText(const cv::Size& size) {
  return std::to_string(size.width) + "x" + std::to_string(size.height);
}

}  // namespace

std::optional<std::string> SequenceOptions::Problem() const {
  if (first < 0) return "first is " + std::to_string(first) + ", must be at least 0";
  if (last < -1) return "last is " + std::to_string(last) + ", must be at least -1";
  if (last >= 0 && last < first) {
    return "last is " + std::to_string(last) + ", must not be before first, " +
           std::to_string(first);
  }
  if (stride < 1) return "stride is " + std::to_string(stride) + ", must be at least 1";
  if (!(fps > 0.0) || !std::isfinite(fps)) {
    return "fps is " + std::to_string(fps) + ", must be positive";
  }
  return std::nullopt;
}

Sequence::Sequence(const Layout& layout)
    : form_(layout.form),
      is_video_(layout.is_video),
      times_source_(layout.times_source),
      times_are_made_up_(layout.times_are_made_up),
      notes_(layout.notes),
      camera_reference_(layout.camera),
      own_camera_(layout.own_camera),
      ground_truth_file_(layout.ground_truth_file) {}

std::optional<Frame> Sequence::Next() {
  std::optional<Frame> frame = Decode();
  if (frame && !frame->image.empty() && frame->image.size() != image_size_) {
    frame->problem = "image is " + SizeText(frame->image.size()) + ", the first readable one is " +
                     SizeText(image_size_);
    frame->image.release();
  }
  return frame;
}

std::string Sequence::Describe() const {
  std::ostringstream text;
  text << form_ << ", ";
  if (num_frames_ >= 0) text << num_frames_ << " frames, ";
  text << SizeText(image_size_) << ", ";
  if (timestamps_s_.size() > 1) {
    text << std::fixed << std::setprecision(1) << timestamps_s_.back() - timestamps_s_.front()
         << " s, ";
  }
  text << place_.string();
  return text.str();
}

Camera MatchToImages(const Camera& camera, const cv::Size& image_size) {
  Camera matched = camera;
  if (camera.width == 0 && camera.height == 0) {
    matched.width = image_size.width;
    matched.height = image_size.height;
  }
  const double scale = static_cast<double>(image_size.width) / matched.width;
  // Sizes that nearly agree are of other pictures, cut or undistorted otherwise.
  constexpr int kNearly_px = 8;
  if (std::abs(matched.width - image_size.width) > kNearly_px &&
      std::abs(scale * matched.height - image_size.height) <= std::max(1.0, scale)) {
    matched.width = image_size.width;
    matched.height = image_size.height;
    matched.fx *= scale;
    matched.fy *= scale;
    // Centres of pixels are whole numbers.
    matched.cx = scale * (matched.cx + 0.5) - 0.5;
    matched.cy = scale * (matched.cy + 0.5) - 0.5;
    return matched;
  }
  if (matched.width != image_size.width || matched.height != image_size.height) {
    const bool is_turned = camera.width == image_size.height && camera.height == image_size.width;
    throw std::runtime_error("camera says " + SizeText({camera.width, camera.height}) +
                             ", images are " + SizeText(image_size) +
                             (is_turned
                                  ? ": calibrate with the camera held as it was here, upright "
                                    "and across are two calibrations"
                                  : ": give the calibration of these images"));
  }
  return matched;
}

}  // namespace rotslam
