#include "rotodom/sequence/spherical.h"

#include <algorithm>
#include <cstdlib>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

namespace rotslam {
namespace {

// Mean absolute difference of two columns, grey levels.
double ColumnDifference(const cv::Mat& grey, int a, int b) {
  return cv::norm(grey.col(a), grey.col(b), cv::NORM_L1) / grey.rows;
}

double Deviation(const cv::Mat& values) {
  cv::Scalar mean;
  cv::Scalar deviation;
  cv::meanStdDev(values, mean, deviation);
  return deviation[0];
}

// Whether the step from the last column to the first is as small as a step between neighbours, and
// far smaller than that between distant columns.
bool EdgesMeet(const cv::Mat& grey) {
  // Grey levels: noise and compression between two neighbours, and the structure that an edge must
  // have. Factors: steps that count as alike and as different.
  constexpr double kNoise = 2.0;
  constexpr double kLeastStructure = 8.0;
  constexpr double kAlike = 2.0;
  constexpr double kDifferent = 3.0;
  const int last = grey.cols - 1;
  if (Deviation(grey.col(0)) < kLeastStructure) return false;
  const double across_edges = ColumnDifference(grey, last, 0);
  const double step = 0.5 * (ColumnDifference(grey, 0, 1) + ColumnDifference(grey, last - 1, last));
  const double far =
      0.5 * (ColumnDifference(grey, 0, grey.cols / 4) + ColumnDifference(grey, 0, grey.cols / 2));
  return across_edges < kAlike * step + kNoise && far > kDifferent * across_edges;
}

// Whether the first and the last row are nearly constant, unlike the rows between.
bool PolesAreConstant(const cv::Mat& grey) {
  // Grey levels of noise, and the largest share of the usual deviation.
  constexpr double kNoise = 4.0;
  constexpr double kShare = 0.2;
  const double usual = Deviation(grey.rowRange(grey.rows / 4, grey.rows * 3 / 4));
  const double limit = std::max(kNoise, kShare * usual);
  return usual > 2.0 * kNoise && Deviation(grey.row(0)) < limit &&
         Deviation(grey.row(grey.rows - 1)) < limit;
}

}  // namespace

bool HasSphericalSize(const cv::Size& size) {
  // Encoders round sizes to multiples of 2 or 16: 0.5 % of the width.
  return size.height > 1 && 200 * std::abs(size.width - 2 * size.height) <= size.width;
}

bool AreSpherical(const std::vector<cv::Mat>& images) {
  bool has_any = false;
  for (const cv::Mat& image : images) {
    if (image.empty()) continue;
    if (!HasSphericalSize(image.size())) return false;
    cv::Mat grey = image;
    if (image.channels() == 3) cv::cvtColor(image, grey, cv::COLOR_BGR2GRAY);
    if (!EdgesMeet(grey) || !PolesAreConstant(grey)) return false;
    has_any = true;
  }
  return has_any;
}

}  // namespace rotslam
