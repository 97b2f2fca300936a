#include "rotodom/motion_blur/blurred_patch.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include <Eigen/Dense>

#include "rotodom/matching/patch_loops.h"

namespace rotslam {
namespace {

// Row lengths of windows are multiples of this.
constexpr int kLanes = BlurRows::kGroup;

int RoundedUp(int size) { return (size + kLanes - 1) / kLanes * kLanes; }

// Weight of the pixel at an offset.
struct Tap {
  Eigen::Vector2i offset;
  float weight;
};

// Memory for one window, which every call of a thread uses again.
struct WindowMemory {
  std::vector<Tap> taps;
  std::vector<BlurTap> offsets;
  std::vector<float> pixels;
  std::vector<std::uint8_t> means;
};

// A blurred part of an image around a point.
struct BlurredWindow {
  cv::Mat pixels;             // in a WindowMemory
  Eigen::Vector2d origin_px;  // position of its first pixel in the image
};

// Weights of the mean along a blur vector, bilinear between pixels.
void FindTaps(const Eigen::Vector2d& blur_px, std::vector<Tap>& taps) {
  // At least two steps, so that the smoothing grows continuously from short blur vectors on.
  const int num_steps =
      blur_px.isZero() ? 1 : std::max(2, static_cast<int>(std::ceil(blur_px.norm())));
  taps.clear();
  const auto add = [&](const Eigen::Vector2i& offset, double weight) {
    if (weight == 0.0) return;
    // Steps are at most a pixel long, so only the taps of the last two steps can be at the same
    // pixel.
    constexpr std::ptrdiff_t kRecent = 8;
    const auto recent = taps.end() - std::min(kRecent, std::ssize(taps));
    auto tap = std::find_if(recent, taps.end(), [&](const Tap& t) { return t.offset == offset; });
    if (tap == taps.end()) tap = taps.insert(tap, {offset, 0.0F});
    tap->weight += static_cast<float>(weight / num_steps);
  };
  for (int step = 0; step < num_steps; ++step) {
    const Eigen::Vector2d at = ((step + 0.5) / num_steps - 0.5) * blur_px;
    const Eigen::Vector2i whole = at.array().floor().cast<int>();
    const Eigen::Vector2d part = at - whole.cast<double>();
    add(whole, (1.0 - part.x()) * (1.0 - part.y()));
    add(whole + Eigen::Vector2i(1, 0), part.x() * (1.0 - part.y()));
    add(whole + Eigen::Vector2i(0, 1), (1.0 - part.x()) * part.y());
    add(whole + Eigen::Vector2i(1, 1), part.x() * part.y());
  }
}

// Copies a window row by row; border pixels are replicated.
void CopyWindow(const cv::Mat& image,
                const Eigen::Vector2i& origin,
                const Eigen::Vector2i& size,
                std::vector<float>& window) {
  const PatchLoops& loops = BestPatchLoops();
  const bool is_inside = origin.x() >= 0 && origin.x() + size.x() <= image.cols;
  window.resize(static_cast<std::size_t>(size.x()) * size.y());
  float* to = window.data();
  for (int y = origin.y(); y < origin.y() + size.y(); ++y, to += size.x()) {
    const std::uint8_t* row = image.ptr<std::uint8_t>(std::clamp(y, 0, image.rows - 1));
    if (is_inside) {
      loops.widen(row + origin.x(), size.x(), to);
      continue;
    }
    for (int x = 0; x < size.x(); ++x) {
      to[x] = static_cast<float>(row[std::clamp(origin.x() + x, 0, image.cols - 1)]);
    }
  }
}

// The mean of the image along the blur vector, for each pixel within `half_side` of the centre.
BlurredWindow BlurredWindowAround(const cv::Mat& image,
                                  const Eigen::Vector2d& center_px,
                                  const Eigen::Vector2d& blur_px,
                                  int half_side,
                                  WindowMemory& memory) {
  const int side = 2 * half_side + 1;
  const int stride = RoundedUp(side);
  const Eigen::Vector2i margin = (0.5 * blur_px.cwiseAbs()).array().ceil().cast<int>() + 1;
  const Eigen::Vector2i origin(static_cast<int>(std::lround(center_px.x())) - half_side,
                               static_cast<int>(std::lround(center_px.y())) - half_side);
  const Eigen::Vector2i size(stride + 2 * margin.x(), side + 2 * margin.y());
  CopyWindow(image, origin - margin, size, memory.pixels);
  FindTaps(blur_px, memory.taps);
  memory.offsets.clear();
  for (const Tap& tap : memory.taps) {
    memory.offsets.push_back(
        {static_cast<std::ptrdiff_t>(tap.offset.y()) * size.x() + tap.offset.x(), tap.weight});
  }
  memory.means.resize(static_cast<std::size_t>(side) * stride);
  const BlurRows rows{
      memory.pixels.data() + static_cast<std::ptrdiff_t>(margin.y()) * size.x() + margin.x(),
      size.x(),
      side,
      stride,
      memory.means.data()};
  BestPatchLoops().blur(memory.offsets.data(), static_cast<int>(memory.offsets.size()), &rows);
  return {cv::Mat(side, stride, CV_8U, memory.means.data()), origin.cast<double>()};
}

}  // namespace

bool AreBlurredAlike(const Eigen::Matrix2d& target_from_view,
                     const Eigen::Vector2d& blur_in_view,
                     const Eigen::Vector2d& blur_in_target) {
  constexpr double kVisibleDifferencePx = 0.5;  // less blur than that of interpolation
  const Eigen::Vector2d blur_vector = target_from_view * blur_in_view;
  // The sign of a blur vector has no effect.
  return std::min((blur_vector - blur_in_target).norm(), (blur_vector + blur_in_target).norm()) <=
         kVisibleDifferencePx;
}

std::optional<PatchAlignment> AlignBlurredPatch(const BlurredPatch& patch,
                                                const cv::Mat& target,
                                                const Eigen::Vector2d& start_px,
                                                const Eigen::Vector2d& blur_px,
                                                double max_step_px) {
  // Near the limits of a lens model, blur vectors and warps may be arbitrarily large: bounds in
  // pixels, and as a ratio of lengths.
  constexpr double kLongestBlurPx = 4.0 * kPatchSide;
  constexpr double kMostStretch = 4.0;
  // Extent of a patch around its centre, px: half of it, one for gradients and two for rounding.
  constexpr int kReach = kPatchSide / 2 + 3;
  const Eigen::Matrix2d view_from_target = patch.target_from_view.inverse();
  const Eigen::Vector2d blur_in_view = view_from_target * blur_px;
  const Eigen::Vector2d blur_in_target = patch.target_from_view * patch.blur_px;
  const double stretch = view_from_target.cwiseAbs().rowwise().sum().maxCoeff();
  const double longest_px = std::max(blur_in_view.norm(), blur_in_target.norm());
  if (!(longest_px <= kLongestBlurPx && stretch <= kMostStretch)) return std::nullopt;
  thread_local WindowMemory memory_of_view;
  thread_local WindowMemory memory_of_target;
  const BlurredWindow from =
      BlurredWindowAround(patch.image,
                          patch.center_px,
                          blur_in_view,
                          static_cast<int>(std::ceil(std::max(1.0, stretch) * kReach)),
                          memory_of_view);
  const auto sampled =
      PatchTemplate::Sample(from.pixels, patch.center_px - from.origin_px, patch.target_from_view);
  if (!sampled) return std::nullopt;
  // Most patches are found nearby, where a small window is enough; one that leaves it is sought
  // again in the whole one.
  constexpr int kNearPx = 2;
  const int reach_px = static_cast<int>(std::ceil(max_step_px));
  for (const int window_px : {std::min(kNearPx, reach_px), reach_px}) {
    const BlurredWindow in =
        BlurredWindowAround(target, start_px, blur_in_target, kReach + window_px, memory_of_target);
    auto found = AlignPatch(*sampled, in.pixels, start_px - in.origin_px, max_step_px);
    if (!found && window_px < reach_px) continue;
    if (found) found->center_px += in.origin_px;
    return found;
  }
  return std::nullopt;
}

}  // namespace rotslam
