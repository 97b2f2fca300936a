#include "rotodom/features/features.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>

#include "rotodom/types/options.h"
#include "rotodom/types/parallel.h"

namespace rotslam {
namespace {

// Half the side of ORB's patch; corners nearer to the border have no descriptor.
constexpr int kHalfPatch = 15;
constexpr int kBorder = kHalfPatch + 4;

struct Corner {
  cv::Point position;
  float response;
};

// Half-widths of the rows of a disc of radius kHalfPatch.
std::array<int, kHalfPatch + 1> DiscHalfWidths() {
  std::array<int, kHalfPatch + 1> widths;
  for (int v = 0; v <= kHalfPatch; ++v) {
    widths[v] = static_cast<int>(std::lround(std::sqrt(double(kHalfPatch * kHalfPatch - v * v))));
  }
  return widths;
}

// Direction from the corner to the centroid of the grey values around it.
float CentroidAngle(const cv::Mat& image, const cv::Point& center) {
  static const std::array<int, kHalfPatch + 1> half_widths = DiscHalfWidths();
  int moment_x = 0;
  int moment_y = 0;
  for (int v = -kHalfPatch; v <= kHalfPatch; ++v) {
    const std::uint8_t* row = image.ptr<std::uint8_t>(center.y + v) + center.x;
    const int half_width = half_widths[std::abs(v)];
    int row_sum = 0;
    for (int u = -half_width; u <= half_width; ++u) {
      row_sum += row[u];
      moment_x += u * row[u];
    }
    moment_y += v * row_sum;
  }
  return std::atan2(static_cast<float>(moment_y), static_cast<float>(moment_x));
}

// Corners sorted into square cells; in each, strongest first, weak ones only where there is no
// strong one.
std::vector<std::vector<Corner>> SortIntoCells(const std::vector<cv::KeyPoint>& detected,
                                               const cv::Rect& area,
                                               int cell,
                                               int strong_threshold) {
  const int columns = (area.width + cell - 1) / cell;
  const int rows = (area.height + cell - 1) / cell;
  std::vector<std::vector<Corner>> cells(static_cast<std::size_t>(columns) * rows);
  for (const cv::KeyPoint& keypoint : detected) {
    const cv::Point position(static_cast<int>(keypoint.pt.x), static_cast<int>(keypoint.pt.y));
    cells[(position.y / cell) * columns + position.x / cell].push_back(
        {position + area.tl(), keypoint.response});
  }
  for (std::vector<Corner>& corners : cells) {
    std::sort(corners.begin(), corners.end(), [](const Corner& a, const Corner& b) {
      if (a.response != b.response) return a.response > b.response;
      if (a.position.y != b.position.y) return a.position.y < b.position.y;
      return a.position.x < b.position.x;
    });
    if (corners.empty() || corners.front().response < static_cast<float>(strong_threshold))
      continue;
    while (corners.back().response < static_cast<float>(strong_threshold)) corners.pop_back();
  }
  return cells;
}

// Takes the best corner of every cell, then the second of every cell, and so on until `count` are
// chosen.
std::vector<Corner> ChooseByTurns(const std::vector<std::vector<Corner>>& cells, int count) {
  std::vector<Corner> chosen;
  for (std::size_t turn = 0; static_cast<int>(chosen.size()) < count; ++turn) {
    std::vector<Corner> this_turn;
    for (const std::vector<Corner>& corners : cells) {
      if (turn < corners.size()) this_turn.push_back(corners[turn]);
    }
    if (this_turn.empty()) break;
    const std::size_t room = count - chosen.size();
    if (this_turn.size() > room) {
      std::stable_sort(this_turn.begin(), this_turn.end(), [](const Corner& a, const Corner& b) {
        return a.response > b.response;
      });
      this_turn.resize(room);
    }
    chosen.insert(chosen.end(), this_turn.begin(), this_turn.end());
  }
  std::sort(chosen.begin(), chosen.end(), [](const Corner& a, const Corner& b) {
    return a.position.y != b.position.y ? a.position.y < b.position.y : a.position.x < b.position.x;
  });
  return chosen;
}

std::vector<Corner> DetectOnLevel(const cv::Mat& image, int count, const FeatureOptions& options) {
  const cv::Rect area(kBorder, kBorder, image.cols - 2 * kBorder, image.rows - 2 * kBorder);
  if (area.width <= 0 || area.height <= 0 || count <= 0) return {};
  std::vector<cv::KeyPoint> detected;
  cv::FAST(image(area), detected, options.min_fast_threshold, true);
  // About two features to a cell.
  const double cell = std::sqrt(2.0 * area.width * area.height / count);
  const auto cells =
      SortIntoCells(detected, area, std::max(8, static_cast<int>(cell)), options.fast_threshold);
  return ChooseByTurns(cells, count);
}

// Features per level, proportional to the level's side length as in ORB; they sum to max_features.
std::vector<int> CountsPerLevel(const FeatureOptions& options) {
  std::vector<double> shares(options.num_levels);
  double sum = 0.0;
  for (int level = 0; level < options.num_levels; ++level) {
    shares[level] = std::pow(options.scale_factor, -level);
    sum += shares[level];
  }
  std::vector<int> counts(options.num_levels);
  double share = 0.0;  // of this level and those before it
  int given = 0;
  for (int level = 0; level < options.num_levels; ++level) {
    share += shares[level] / sum;
    counts[level] = static_cast<int>(std::lround(options.max_features * share)) - given;
    given += counts[level];
  }
  return counts;
}

std::array<std::uint8_t, 3> ColourAt(const cv::Mat& image, const cv::Point2f& position) {
  const int x = std::clamp(static_cast<int>(std::lround(position.x)), 0, image.cols - 1);
  const int y = std::clamp(static_cast<int>(std::lround(position.y)), 0, image.rows - 1);
  if (image.channels() == 1) {
    const std::uint8_t grey = image.at<std::uint8_t>(y, x);
    return {grey, grey, grey};
  }
  const cv::Vec3b bgr = image.at<cv::Vec3b>(y, x);
  return {bgr[2], bgr[1], bgr[0]};
}

}  // namespace

std::optional<std::string> FeatureOptions::Problem() const {
  if (max_features < 50) return OutOfRange("max_features", max_features, "at least 50");
  if (num_levels < 1 || num_levels > 16) return OutOfRange("num_levels", num_levels, "1 to 16");
  if (!(scale_factor > 1.0 && scale_factor <= 2.0)) {
    return OutOfRange("scale_factor", scale_factor, "above 1 and at most 2");
  }
  if (min_fast_threshold < 1)
    return OutOfRange("min_fast_threshold", min_fast_threshold, "positive");
  if (fast_threshold < min_fast_threshold) {
    return OutOfRange("fast_threshold", fast_threshold, "at least min_fast_threshold");
  }
  return std::nullopt;
}

cv::Mat ToGrey(const cv::Mat& image) {
  if (image.channels() == 1) return image;
  cv::Mat grey;
  cv::cvtColor(image, grey, cv::COLOR_BGR2GRAY);
  return grey;
}

Features ExtractFeatures(const cv::Mat& image,
                         FrameId frame,
                         const Camera& camera,
                         const FeatureOptions& options,
                         int num_threads) {
  if (const auto problem = options.Problem()) {
    throw std::invalid_argument("FeatureOptions: " + *problem);
  }
  if (image.empty() || image.depth() != CV_8U || (image.channels() != 1 && image.channels() != 3)) {
    throw std::invalid_argument(
        "ExtractFeatures: the image must be 8-bit with one or three channels");
  }
  const cv::Mat grey = ToGrey(image);
  const std::vector<int> counts = CountsPerLevel(options);
  std::vector<std::vector<cv::KeyPoint>> keypoints_of_level(options.num_levels);
  ParallelFor(options.num_levels, num_threads, [&](int level) {
    const double scale = std::pow(options.scale_factor, level);
    const cv::Size size(static_cast<int>(std::lround(grey.cols / scale)),
                        static_cast<int>(std::lround(grey.rows / scale)));
    if (std::min(size.width, size.height) <= 2 * kBorder) return;
    cv::Mat scaled = grey;
    if (level > 0) cv::resize(grey, scaled, size, 0.0, 0.0, cv::INTER_AREA);
    // Pixel centres map to pixel centres: (x + 1/2) * scale - 1/2.
    const double scale_x = static_cast<double>(grey.cols) / size.width;
    const double scale_y = static_cast<double>(grey.rows) / size.height;
    for (const Corner& corner : DetectOnLevel(scaled, counts[level], options)) {
      cv::KeyPoint keypoint;
      keypoint.pt.x = static_cast<float>((corner.position.x + 0.5) * scale_x - 0.5);
      keypoint.pt.y = static_cast<float>((corner.position.y + 0.5) * scale_y - 0.5);
      keypoint.octave = level;
      keypoint.angle = CentroidAngle(scaled, corner.position) * 180.0F / static_cast<float>(CV_PI);
      keypoint.response = corner.response;
      keypoint.size = static_cast<float>((2 * kHalfPatch + 1) * scale);
      keypoints_of_level[level].push_back(keypoint);
    }
  });
  std::vector<cv::KeyPoint> keypoints;
  for (const auto& level : keypoints_of_level)
    keypoints.insert(keypoints.end(), level.begin(), level.end());

  Features features;
  features.frame = frame;
  if (keypoints.empty()) return features;
  const cv::Ptr<cv::ORB> orb = cv::ORB::create(options.max_features,
                                               static_cast<float>(options.scale_factor),
                                               options.num_levels,
                                               kBorder,
                                               0,
                                               2,
                                               cv::ORB::HARRIS_SCORE,
                                               2 * kHalfPatch + 1);
  cv::Mat descriptors;
  orb->compute(grey, keypoints, descriptors);

  std::vector<int> kept;
  for (int index = 0; index < static_cast<int>(keypoints.size()); ++index) {
    const Eigen::Vector2d position(keypoints[index].pt.x, keypoints[index].pt.y);
    const auto bearing = camera.Unproject(position);
    if (!bearing) continue;
    kept.push_back(index);
    features.keypoints_px.push_back(position);
    features.bearings.push_back(*bearing);
    features.levels.push_back(keypoints[index].octave);
    features.angles_rad.push_back(keypoints[index].angle * static_cast<float>(CV_PI) / 180.0F);
    features.rgb.push_back(ColourAt(image, keypoints[index].pt));
  }
  features.descriptors.create(static_cast<int>(kept.size()), descriptors.cols, CV_8U);
  for (int row = 0; row < static_cast<int>(kept.size()); ++row) {
    descriptors.row(kept[row]).copyTo(features.descriptors.row(row));
  }
  return features;
}

}  // namespace rotslam
