#include "rotodom/tracking/blur.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include <Eigen/Dense>

namespace rotslam {
namespace {

using Pixels = Eigen::Map<Eigen::ArrayXf>;

// A part of an image around a point, smeared.
struct SmearedWindow {
  cv::Mat pixels;
  Eigen::Vector2d origin_px;  // where its first pixel is in the image
};

// Pixels by row; beyond its border the image goes on as it ends there.
std::vector<float> CopyWindow(const cv::Mat& image, const Eigen::Vector2i& origin, int side) {
  std::vector<float> window;
  window.reserve(static_cast<std::size_t>(side) * side);
  for (int y = origin.y(); y < origin.y() + side; ++y) {
    const std::uint8_t* row = image.ptr<std::uint8_t>(std::clamp(y, 0, image.rows - 1));
    for (int x = origin.x(); x < origin.x() + side; ++x) {
      window.push_back(static_cast<float>(row[std::clamp(x, 0, image.cols - 1)]));
    }
  }
  return window;
}

// The mean of the image along the streak, for each pixel within `half_side` of the centre.
SmearedWindow SmearAround(const cv::Mat& image,
                          const Eigen::Vector2d& center_px,
                          const Eigen::Vector2d& streak_px,
                          int half_side) {
  const int side = 2 * half_side + 1;
  const int margin = static_cast<int>(std::ceil(0.5 * streak_px.cwiseAbs().maxCoeff())) + 1;
  const int wide = side + 2 * margin;
  const Eigen::Vector2i origin(static_cast<int>(std::lround(center_px.x())) - half_side,
                               static_cast<int>(std::lround(center_px.y())) - half_side);
  std::vector<float> pixels = CopyWindow(image, origin - Eigen::Vector2i::Constant(margin), wide);
  std::vector<float> sum(static_cast<std::size_t>(side) * side, 0.0F);
  // Two at least: short streaks smooth a little, not by steps.
  const int num_steps =
      streak_px.isZero() ? 1 : std::max(2, static_cast<int>(std::ceil(streak_px.norm())));
  for (int step = 0; step < num_steps; ++step) {
    const Eigen::Vector2d at = ((step + 0.5) / num_steps - 0.5) * streak_px;
    const Eigen::Vector2d whole = at.array().floor();
    const Eigen::Vector2f part = (at - whole).cast<float>();
    const float w00 = (1.0F - part.x()) * (1.0F - part.y());
    const float w10 = part.x() * (1.0F - part.y());
    const float w01 = (1.0F - part.x()) * part.y();
    const float w11 = part.x() * part.y();
    float* from = pixels.data() + (margin + static_cast<int>(whole.y())) * wide + margin +
                  static_cast<int>(whole.x());
    for (int y = 0; y < side; ++y, from += wide) {
      Pixels(sum.data() + static_cast<std::ptrdiff_t>(y) * side, side) +=
          w00 * Pixels(from, side) + w10 * Pixels(from + 1, side) +
          w01 * Pixels(from + wide, side) + w11 * Pixels(from + wide + 1, side);
    }
  }
  SmearedWindow smeared{cv::Mat(side, side, CV_8U), origin.cast<double>()};
  std::transform(sum.begin(), sum.end(), smeared.pixels.data, [&](float value) {
    return static_cast<std::uint8_t>(value / static_cast<float>(num_steps) + 0.5F);
  });
  return smeared;
}

}  // namespace

std::optional<PatchAlignment> AlignBlurredPatch(const BlurredPatch& patch,
                                                const cv::Mat& target,
                                                const Eigen::Vector2d& start_px,
                                                const Eigen::Vector2d& streak_px,
                                                double max_step_px) {
  // What a patch reaches beyond its centre: half of it, a pixel for gradients and two for rounding.
  constexpr int kReach = kPatchSide / 2 + 3;
  const Eigen::Matrix2d view_from_target = patch.target_from_view.inverse();
  const double stretch = std::max(1.0, view_from_target.cwiseAbs().rowwise().sum().maxCoeff());
  const SmearedWindow from = SmearAround(patch.image,
                                         patch.center_px,
                                         view_from_target * streak_px,
                                         static_cast<int>(std::ceil(stretch * kReach)));
  const auto sampled =
      PatchTemplate::Sample(from.pixels, patch.center_px - from.origin_px, patch.target_from_view);
  if (!sampled) return std::nullopt;
  const SmearedWindow in = SmearAround(target,
                                       start_px,
                                       patch.target_from_view * patch.streak_px,
                                       kReach + static_cast<int>(std::ceil(max_step_px)));
  auto found = AlignPatch(*sampled, in.pixels, start_px - in.origin_px, max_step_px);
  if (found) found->center_px += in.origin_px;
  return found;
}

}  // namespace rotslam
