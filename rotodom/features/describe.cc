#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

#include <opencv2/core.hpp>

#include "rotodom/features/binary_descriptor.h"
#include "rotodom/features/features.h"
#include "rotodom/features/orb_descriptor.h"
#include "rotodom/types/parallel.h"

namespace rotslam {
namespace {

// A copy of the pixels around a position; outside of the image they are mirrored.
template <int kBefore, int kSize>
class MirroredPatch {
 public:
  // From kBefore pixels before `place` on, kSize pixels square.
  MirroredPatch(const cv::Mat& image, const cv::Point& place) {
    std::array<int, kSize> columns;
    for (int x = 0; x < kSize; ++x) {
      columns[x] = cv::borderInterpolate(place.x - kBefore + x, image.cols, cv::BORDER_REFLECT_101);
    }
    for (int y = 0; y < kSize; ++y) {
      const std::uint8_t* row = image.ptr<std::uint8_t>(
          cv::borderInterpolate(place.y - kBefore + y, image.rows, cv::BORDER_REFLECT_101));
      for (int x = 0; x < kSize; ++x) pixels_[y * kSize + x] = row[columns[x]];
    }
  }

  // The pixel at `place`.
  const std::uint8_t* place() const { return pixels_.data() + kBefore * kSize + kBefore; }
  static constexpr int step() { return kSize; }

 private:
  std::array<std::uint8_t, std::size_t{kSize} * kSize> pixels_;
};

bool IsInside(const cv::Mat& image, const cv::Point& center, int reach) {
  return center.x >= reach && center.y >= reach && center.x < image.cols - reach &&
         center.y < image.rows - reach;
}

// Blurs the blocks around the centres. Other pixels of the result are undefined. Its size is
// rounded up to whole blocks.
cv::Mat BlurAround(const cv::Mat& image, const std::vector<cv::Point>& centers) {
  const int columns = (image.cols + kBlurBlock - 1) / kBlurBlock;
  const int rows = (image.rows + kBlurBlock - 1) / kBlurBlock;
  std::vector<char> needed(static_cast<std::size_t>(columns) * rows, 0);
  for (const cv::Point& center : centers) {
    // A patch that leaves the image is mirrored, from pixels within twice the reach of the border.
    const int reach = IsInside(image, center, kOrbReach) ? kOrbReach : 2 * kOrbReach;
    const int first_row = std::max(0, center.y - reach) / kBlurBlock;
    const int last_row = std::min(image.rows - 1, center.y + reach) / kBlurBlock;
    const int first_column = std::max(0, center.x - reach) / kBlurBlock;
    const int last_column = std::min(image.cols - 1, center.x + reach) / kBlurBlock;
    for (int row = first_row; row <= last_row; ++row) {
      std::fill(needed.begin() + row * columns + first_column,
                needed.begin() + row * columns + last_column + 1,
                char{1});
    }
  }
  cv::Mat blurred(rows * kBlurBlock, columns * kBlurBlock, CV_8UC1);
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      if (needed[row * columns + column] == 0) continue;
      const cv::Point corner(column * kBlurBlock, row * kBlurBlock);
      std::uint8_t* to = blurred.ptr<std::uint8_t>(corner.y) + corner.x;
      const auto to_step = static_cast<std::ptrdiff_t>(blurred.step);
      if (corner.x >= kBlurReach && corner.y >= kBlurReach &&
          corner.x + kBlurBlock + kBlurMargin - kBlurReach <= image.cols &&
          corner.y + kBlurBlock + kBlurReach <= image.rows) {
        BlurBlock(image.ptr<std::uint8_t>(corner.y) + corner.x,
                  static_cast<std::ptrdiff_t>(image.step),
                  to,
                  to_step);
      } else {
        const MirroredPatch<kBlurReach, kBlurBlock + kBlurMargin> patch(image, corner);
        BlurBlock(patch.place(), patch.step(), to, to_step);
      }
    }
  }
  return blurred;
}

float AngleDegAt(const cv::Mat& image, const cv::Point& center) {
  // The loop reads one column beyond the disc.
  constexpr int kReach = kOrbHalfPatch + 1;
  if (IsInside(image, center, kReach)) {
    return CentroidAngleDeg(image.ptr<std::uint8_t>(center.y) + center.x,
                            static_cast<std::ptrdiff_t>(image.step));
  }
  const MirroredPatch<kReach, 2 * kReach + 1> patch(image, center);
  return CentroidAngleDeg(patch.place(), patch.step());
}

void DescribeAt(const cv::Mat& blurred,
                const cv::Size& size,
                const cv::Point& center,
                float angle_deg,
                std::uint8_t* descriptor) {
  const cv::Mat inside = blurred(cv::Rect(cv::Point(), size));
  if (IsInside(inside, center, kOrbReach)) {
    ComputeOrbDescriptor(blurred.ptr<std::uint8_t>(center.y) + center.x,
                         static_cast<std::ptrdiff_t>(blurred.step),
                         angle_deg,
                         descriptor);
    return;
  }
  const MirroredPatch<kOrbReach, 2 * kOrbReach + 1> patch(inside, center);
  ComputeOrbDescriptor(patch.place(), patch.step(), angle_deg, descriptor);
}

}  // namespace

void DescribeFeatures(const ImagePyramid& pyramid, int num_threads, Features& features, int first) {
  const int n = features.size();
  if (first < 0 || first > n) {
    throw std::invalid_argument("DescribeFeatures: there is no feature to start from");
  }
  if (static_cast<int>(features.angles_rad.size()) < first || features.descriptors.rows < first) {
    throw std::invalid_argument(
        "DescribeFeatures: the features before the first are not described");
  }
  const int num_levels = static_cast<int>(pyramid.levels.size());
  std::vector<std::vector<int>> of_level(num_levels);
  for (int k = first; k < n; ++k) {
    const int level = features.levels[k];
    if (level < 0 || level >= num_levels) {
      throw std::invalid_argument("DescribeFeatures: a feature has no level of the pyramid");
    }
    if (!features.keypoints_px[k].allFinite()) {
      throw std::invalid_argument("DescribeFeatures: a feature has no finite position");
    }
    of_level[level].push_back(k);
  }
  features.angles_rad.resize(n);
  cv::Mat descriptors(n, n > 0 ? kDescriptorBytes : 0, CV_8UC1);
  if (first > 0) features.descriptors.rowRange(0, first).copyTo(descriptors.rowRange(0, first));
  features.descriptors = descriptors;

  ParallelFor(num_levels, num_threads, [&](int level) {
    const cv::Mat& image = pyramid.levels[level];
    std::vector<cv::Point> centers;
    for (const int k : of_level[level]) {
      const Eigen::Vector2d position = pyramid.ToLevel(features.keypoints_px[k], level);
      centers.emplace_back(
          static_cast<int>(std::lround(std::clamp(position.x(), 0.0, image.cols - 1.0))),
          static_cast<int>(std::lround(std::clamp(position.y(), 0.0, image.rows - 1.0))));
    }
    if (centers.empty()) return;
    const cv::Mat blurred = BlurAround(image, centers);
    for (std::size_t index = 0; index < centers.size(); ++index) {
      const int k = of_level[level][index];
      const float angle_deg = AngleDegAt(image, centers[index]);
      features.angles_rad[k] = angle_deg * kOrbRadPerDeg;
      DescribeAt(
          blurred, image.size(), centers[index], angle_deg, descriptors.ptr<std::uint8_t>(k));
    }
  });
}

}  // namespace rotslam
