#pragma once

#include <cmath>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "rotodom/features/features.h"

namespace rotslam {

/// The image turned about its centre and magnified, each pixel with its own noise.
struct WarpedImage {
  cv::Mat image;
  cv::Matx23d warped_from_image;
};

inline WarpedImage Warp(
    const cv::Mat& image, double turn_deg, double scale, double noise_grey, int seed) {
  WarpedImage warped;
  const cv::Point2f center(0.5F * static_cast<float>(image.cols - 1),
                           0.5F * static_cast<float>(image.rows - 1));
  warped.warped_from_image = cv::getRotationMatrix2D(center, turn_deg, scale);
  cv::warpAffine(image,
                 warped.image,
                 warped.warped_from_image,
                 image.size(),
                 cv::INTER_CUBIC,
                 cv::BORDER_REFLECT_101);
  cv::Mat noise(image.size(), CV_16S);
  cv::RNG random(static_cast<std::uint64_t>(seed));
  random.fill(noise, cv::RNG::NORMAL, 0.0, noise_grey);
  cv::Mat sum;
  cv::add(warped.image, noise, sum, cv::noArray(), CV_8U);
  warped.image = sum;
  return warped;
}

struct Repeatability {
  int visible = 0;      // features of the first image that the second shows too
  int found_again = 0;  // have one of the second within 1.5 pixels of their level
  int matched = 0;      // and that one is nearest by descriptor, among all of the second
};

/// How many features of an image are found again in its warped copy, at a level within one of what
/// the scale says, and told apart by their descriptors.
inline Repeatability Compare(const std::vector<cv::KeyPoint>& features,
                             const cv::Mat& descriptors,
                             const std::vector<cv::KeyPoint>& of_warped,
                             const cv::Mat& descriptors_of_warped,
                             const WarpedImage& warped,
                             double warp_scale,
                             double scale_factor) {
  constexpr double kMargin = 24.0;
  Repeatability result;
  for (std::size_t i = 0; i < features.size(); ++i) {
    const double level_scale = std::pow(scale_factor, features[i].octave);
    const cv::Vec2d there =
        warped.warped_from_image * cv::Vec3d(features[i].pt.x, features[i].pt.y, 1.0);
    const double margin = kMargin * level_scale;
    if (there[0] < margin || there[1] < margin || there[0] > warped.image.cols - margin ||
        there[1] > warped.image.rows - margin) {
      continue;
    }
    ++result.visible;
    const auto is_same = [&](const cv::KeyPoint& other) {
      const double step =
          other.octave - features[i].octave - std::log(warp_scale) / std::log(scale_factor);
      return std::abs(step) <= 1.0 && std::hypot(other.pt.x - there[0], other.pt.y - there[1]) <=
                                          1.5 * level_scale * warp_scale;
    };
    bool again = false;
    for (const cv::KeyPoint& other : of_warped) again = again || is_same(other);
    if (!again) continue;
    ++result.found_again;
    std::size_t nearest = 0;
    double least = 257.0;
    for (std::size_t j = 0; j < of_warped.size(); ++j) {
      const double distance = cv::norm(descriptors.row(static_cast<int>(i)),
                                       descriptors_of_warped.row(static_cast<int>(j)),
                                       cv::NORM_HAMMING);
      if (distance >= least) continue;
      least = distance;
      nearest = j;
    }
    if (is_same(of_warped[nearest])) ++result.matched;
  }
  return result;
}

inline std::vector<cv::KeyPoint> ToKeyPoints(const Features& features) {
  std::vector<cv::KeyPoint> keypoints(features.keypoints_px.size());
  for (std::size_t k = 0; k < keypoints.size(); ++k) {
    keypoints[k].pt = cv::Point2f(static_cast<float>(features.keypoints_px[k].x()),
                                  static_cast<float>(features.keypoints_px[k].y()));
    keypoints[k].octave = features.levels[k];
  }
  return keypoints;
}

}  // namespace rotslam
