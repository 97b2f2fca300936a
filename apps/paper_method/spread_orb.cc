#include "apps/paper_method/spread_orb.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <tuple>
#include <utility>

#include "rotodom/types/parallel.h"

namespace rotslam {
namespace {

// Side of a cell that is searched with one threshold, pixels of its level (ORB-SLAM2).
constexpr int kCellPx = 30;
// Corners keep this from the border of their level, so that ORB's patch lies inside (ORB-SLAM2).
constexpr int kBorderPx = 19;

// A part of the area and the corners in it.
struct Part {
  cv::Rect2d area;
  std::vector<FastCorner> corners;
};

std::array<Part, 4> Quarters(const Part& part) {
  const double width = 0.5 * part.area.width;
  const double height = 0.5 * part.area.height;
  std::array<Part, 4> quarters;
  for (int k = 0; k < 4; ++k) {
    const bool is_right = k % 2 == 1;
    const bool is_below = k >= 2;
    quarters[k].area = {part.area.x + (is_right ? width : 0.0),
                        part.area.y + (is_below ? height : 0.0),
                        width,
                        height};
  }
  for (const FastCorner& corner : part.corners) {
    const int right = corner.x >= quarters[1].area.x ? 1 : 0;
    const int below = corner.y >= quarters[2].area.y ? 2 : 0;
    quarters[right + below].corners.push_back(corner);
  }
  return quarters;
}

// As many squares side by side as fit the area best.
std::vector<Part> FirstParts(const std::vector<FastCorner>& corners, const cv::Rect& area) {
  const int count =
      std::max(1, static_cast<int>(std::lround(static_cast<double>(area.width) / area.height)));
  const double width = static_cast<double>(area.width) / count;
  std::vector<Part> parts(count);
  for (int k = 0; k < count; ++k) {
    parts[k].area = cv::Rect2d(area.x + k * width, area.y, width, area.height);
  }
  for (const FastCorner& corner : corners) {
    const int k = static_cast<int>((corner.x - area.x) / width);
    parts[std::clamp(k, 0, count - 1)].corners.push_back(corner);
  }
  std::erase_if(parts, [](const Part& part) { return part.corners.empty(); });
  return parts;
}

// One round: quarters every part with several corners, those with the most first, until there are
// enough. False where nothing is left to divide.
bool Divide(std::size_t count, std::vector<Part>& parts) {
  std::stable_sort(parts.begin(), parts.end(), [](const Part& a, const Part& b) {
    return a.corners.size() > b.corners.size();
  });
  std::size_t num_parts = parts.size();
  bool has_divided = false;
  std::vector<Part> divided;
  for (Part& part : parts) {
    if (part.corners.size() < 2 || num_parts >= count) {
      divided.push_back(std::move(part));
      continue;
    }
    has_divided = true;
    --num_parts;
    for (Part& quarter : Quarters(part)) {
      if (quarter.corners.empty()) continue;
      ++num_parts;
      divided.push_back(std::move(quarter));
    }
  }
  parts = std::move(divided);
  return has_divided;
}

bool IsBefore(const FastCorner& a, const FastCorner& b) {
  return std::tie(a.y, a.x) < std::tie(b.y, b.x);
}

// Corners of a level, each cell with the threshold that finds some.
std::vector<FastCorner> CornersByCell(const cv::Mat& level,
                                      const cv::Rect& area,
                                      const FeatureOptions& options) {
  const int cols = std::max(1, area.width / kCellPx);
  const int rows = std::max(1, area.height / kCellPx);
  std::vector<FastCorner> corners;
  for (int row = 0; row < rows; ++row) {
    for (int col = 0; col < cols; ++col) {
      const int x0 = area.x + area.width * col / cols;
      const int y0 = area.y + area.height * row / rows;
      const int x1 = area.x + area.width * (col + 1) / cols;
      const int y1 = area.y + area.height * (row + 1) / rows;
      const cv::Rect cell(x0, y0, x1 - x0, y1 - y0);
      std::vector<FastCorner> found = FindFastCorners(level, cell, options.fast_threshold);
      if (found.empty()) found = FindFastCorners(level, cell, options.min_fast_threshold);
      corners.insert(corners.end(), found.begin(), found.end());
    }
  }
  return corners;
}

// Features that a level is asked for: shares that fall with the scale and add up to all.
int ShareOf(int level, const FeatureOptions& options) {
  const double ratio = 1.0 / options.scale_factor;
  double sum = 0.0;
  for (int k = 0; k < options.num_levels; ++k) sum += std::pow(ratio, k);
  return static_cast<int>(std::lround(options.max_features * std::pow(ratio, level) / sum));
}

}  // namespace

std::vector<FastCorner> SpreadCorners(const std::vector<FastCorner>& corners,
                                      const cv::Rect& area,
                                      int count) {
  std::vector<FastCorner> spread;
  if (count <= 0 || corners.empty()) return spread;
  std::vector<Part> parts = FirstParts(corners, area);
  while (parts.size() < static_cast<std::size_t>(count)) {
    if (!Divide(static_cast<std::size_t>(count), parts)) break;
  }
  for (const Part& part : parts) {
    spread.push_back(*std::max_element(
        part.corners.begin(), part.corners.end(), [](const FastCorner& a, const FastCorner& b) {
          return a.score != b.score ? a.score < b.score : IsBefore(b, a);
        }));
  }
  std::sort(spread.begin(), spread.end(), IsBefore);
  return spread;
}

Features ExtractSpreadOrb(const MaskedImage& image,
                          FrameId frame,
                          const Camera& camera,
                          const FeatureOptions& options,
                          int num_threads) {
  const ImagePyramid pyramid = BuildPyramid(ToGrey(image.image), options, image.mask);
  const int num_levels = static_cast<int>(pyramid.levels.size());
  std::vector<std::vector<FastCorner>> corners(num_levels);
  ParallelFor(num_levels, num_threads, [&](int level) {
    const cv::Mat& pixels = pyramid.levels[level];
    const cv::Rect area(
        kBorderPx, kBorderPx, pixels.cols - 2 * kBorderPx, pixels.rows - 2 * kBorderPx);
    if (area.width <= 0 || area.height <= 0) return;
    std::vector<FastCorner> found = CornersByCell(pixels, area, options);
    std::erase_if(found, [&](const FastCorner& corner) {
      return pyramid.IsMasked(pyramid.ToImage(Eigen::Vector2d(corner.x, corner.y), level), level);
    });
    corners[level] = SpreadCorners(found, area, ShareOf(level, options));
  });
  Features features;
  features.frame = frame;
  for (int level = 0; level < num_levels; ++level) {
    for (const FastCorner& corner : corners[level]) {
      const Eigen::Vector2d position = pyramid.ToImage(Eigen::Vector2d(corner.x, corner.y), level);
      const std::optional<Eigen::Vector3d> bearing = camera.Unproject(position);
      if (!bearing) continue;
      const std::uint8_t grey = pyramid.levels[level].at<std::uint8_t>(corner.y, corner.x);
      features.keypoints_px.push_back(position);
      features.bearings.push_back(*bearing);
      features.levels.push_back(level);
      features.rgb.push_back({grey, grey, grey});
    }
  }
  DescribeFeatures(pyramid, num_threads, features);
  return features;
}

}  // namespace rotslam
