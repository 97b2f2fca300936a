#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "rotodom/camera/camera.h"
#include "rotodom/types/ids.h"

namespace rotslam {

struct FeatureOptions {
  // Features asked for per frame. More help weak texture and cost time in matching.
  int max_features = 2000;
  // Pyramid levels and the scale between two of them, as ORB-SLAM has them: octave steps of 1.2
  // over a factor of 3.6.
  int num_levels = 8;
  double scale_factor = 1.2;
  // FAST threshold in grey levels; a cell that holds no corner at the first one is searched with
  // the second, so that a dark corner of the image also has features.
  int fast_threshold = 20;
  int min_fast_threshold = 7;

  std::optional<std::string> Problem() const;

  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("max_features", max_features);
    visit("num_levels", num_levels);
    visit("scale_factor", scale_factor);
    visit("fast_threshold", fast_threshold);
    visit("min_fast_threshold", min_fast_threshold);
  }
};

/// One frame's corners, n of them, ordered by level and then by row and column.
struct Features {
  FrameId frame;
  std::vector<Eigen::Vector2d> keypoints_px;  // in the full image; the matcher sharpens them
  std::vector<Eigen::Vector3d> bearings;      // unit, of keypoints_px
  std::vector<int> levels;                    // pyramid level, 0 is the full image
  std::vector<float> angles_rad;              // direction of the intensity centroid
  cv::Mat descriptors;                        // n x 32 bytes, ORB
  std::vector<std::array<std::uint8_t, 3>> rgb;

  int size() const { return static_cast<int>(keypoints_px.size()); }
};

/// 8-bit grey version of a decoded image (8-bit, one or three channels).
cv::Mat ToGrey(const cv::Mat& image);

/// ORB features spread evenly over the image.
/// @param image        8-bit, one or three channels (BGR).
/// @param num_threads  works on pyramid levels side by side; the result does not depend on it.
/// @return  at most options.max_features features; none for an image without corners. A keypoint
/// whose
///          bearing the camera model does not have is left out.
/// Source:  Rublee et al., ORB, ICCV 2011; ours chooses among the FAST corners of a level by turns
/// over
///          a grid, strongest first, so that each part of the image gets its share.
Features ExtractFeatures(const cv::Mat& image,
                         FrameId frame,
                         const Camera& camera,
                         const FeatureOptions& options,
                         int num_threads);

}  // namespace rotslam
