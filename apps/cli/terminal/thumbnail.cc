#include "apps/cli/terminal/thumbnail.h"

#include <algorithm>
#include <string_view>

#include <opencv2/imgproc.hpp>

namespace rotslam {
namespace {

std::string ColourCode(int layer, const cv::Vec3b& pixel) {
  return "\033[" + std::to_string(layer) + ";2;" + std::to_string(pixel[2]) + ";" +
         std::to_string(pixel[1]) + ";" + std::to_string(pixel[0]) + "m";
}

char Shade(const cv::Vec3b& upper, const cv::Vec3b& lower) {
  constexpr std::string_view kShades = " .:-=+*#%@";
  int sum = 0;
  for (int k = 0; k < 3; ++k) sum += upper[k] + lower[k];
  return kShades[static_cast<std::size_t>(sum) * kShades.size() / (6 * 255 + 1)];
}

}  // namespace

std::string TerminalPicture(const cv::Mat& image, int columns, bool in_colour) {
  constexpr int kForeground = 38;
  constexpr int kBackground = 48;
  const int width = std::max(8, columns);
  // An even number of rows: a character shows two.
  const int height = 2 * std::max(1, width * image.rows / (2 * image.cols));
  cv::Mat small;
  cv::resize(image, small, {width, height}, 0.0, 0.0, cv::INTER_AREA);
  if (small.channels() == 1) cv::cvtColor(small, small, cv::COLOR_GRAY2BGR);
  std::string text;
  for (int y = 0; y < height; y += 2) {
    for (int x = 0; x < width; ++x) {
      const auto& upper = small.at<cv::Vec3b>(y, x);
      const auto& lower = small.at<cv::Vec3b>(y + 1, x);
      if (in_colour) {
        text += ColourCode(kForeground, upper) + ColourCode(kBackground, lower) + "\u2580";
      } else {
        text += Shade(upper, lower);
      }
    }
    text += in_colour ? "\033[0m\n" : "\n";
  }
  return text;
}

}  // namespace rotslam
