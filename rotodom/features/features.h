#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "rotodom/camera/camera.h"
#include "rotodom/masks/mask.h"
#include "rotodom/types/ids.h"

namespace rotslam {

/// How many features a frame gets, how they are spread, and how well they are located.
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
  // Pixels of its level that a new feature keeps away from those it finds there: patches tracked
  // from frame to frame that overlap by more than half tell the same thing twice.
  double min_distance_px = 4.0;

  std::optional<std::string> Problem() const;

  // Not configuration: the members that are not visited; programs and tests set them.
  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("max_features", max_features);
    visit("fast_threshold", fast_threshold);
    visit("min_fast_threshold", min_fast_threshold);
    visit("min_distance_px", min_distance_px);
  }
};

// Radius of the circle of pixels that makes a FAST corner.
inline constexpr double kCornerReachPx = 3.0;

/// A frame's image at all scales, each 1 / scale_factor of the one before.
struct ImagePyramid {
  std::vector<cv::Mat> levels;          // 8-bit grey; level 0 shares the image's pixels
  std::vector<Eigen::Vector2d> scales;  // image pixels per pixel of the level, in x and y
  Mask mask;                            // what has no features, in the full image

  // Pixel centres map to pixel centres: (x + 1/2) * scale - 1/2.
  Eigen::Vector2d ToLevel(const Eigen::Vector2d& image_px, int level) const;
  Eigen::Vector2d ToImage(const Eigen::Vector2d& level_px, int level) const;

  // Whether a corner of the level at this position of the full image touches what is masked.
  bool IsMasked(const Eigen::Vector2d& image_px, int level) const {
    return mask.Covers(image_px, kCornerReachPx * scales[level].x());
  }
};

/// One frame's corners, n of them.
struct Features {
  FrameId frame;
  std::vector<Eigen::Vector2d> keypoints_px;  // in the full image; tracked ones lie between pixels
  std::vector<Eigen::Vector3d> bearings;      // unit, of keypoints_px
  std::vector<int> levels;                    // pyramid level, 0 is the full image
  std::vector<std::array<std::uint8_t, 3>> rgb;
  // Covariances of keypoints_px, px^2, set by the tracker from the patch's structure and residual;
  // zero for a new corner, whose patch is the reference of later frames. The relative rotation does
  // not weight matches by them: the errors that limit it are common to neighbouring patches.
  std::vector<Eigen::Matrix2f> covariances_px;
  // Ids of the tracked scene points, ascending; set by the tracker.
  std::vector<TrackId> tracks;
  // Standard deviation of errors that neighbouring keypoints share, set by the tracker: what is
  // unknown of the motion during the readout of a rolling shutter.
  double shared_error_px = 0.0;
  // Set by DescribeFeatures.
  std::vector<float> angles_rad;  // direction of the intensity centroid
  cv::Mat descriptors;            // n x 32 bytes, ORB

  int size() const { return static_cast<int>(keypoints_px.size()); }
};

/// 8-bit grey version of a decoded image (8-bit, one or three channels).
cv::Mat ToGrey(const cv::Mat& image);

/// Builds options.num_levels levels, each by bilinear interpolation from the one before; no side is
/// below one pixel.
/// @param grey  8-bit, one channel; must not change while the pyramid is in use.
/// @param mask  of its size, or empty; throws std::invalid_argument for another size.
ImagePyramid BuildPyramid(const cv::Mat& grey,
                          const FeatureOptions& options,
                          const Mask& mask = {});

/// Detects corners where `features` has none, up to options.max_features in all, evenly spread.
/// @param num_threads  works on levels side by side; the result does not depend on it.
/// @param features     n features carried over from earlier frames (keypoints_px, bearings, levels
///                     and rgb of equal length), or none. They keep their positions in the lists;
///                     new ones are appended, ordered by level, row and column, at whole pixels of
///                     their level, with the grey value as colour. Angles and descriptors are not
///                     changed.
/// Corners that touch the pyramid's mask, or for which the camera model has no bearing, are left
/// out. Each part of a level has a share
/// of the features, and carried features count towards it.
/// Source:  Rublee et al., ORB, ICCV 2011. Ours selects the FAST corners of a level in rounds over
///          a grid, strongest first, so that each part of the image gets its share.
void DetectFeatures(const ImagePyramid& pyramid,
                    const Camera& camera,
                    const FeatureOptions& options,
                    int num_threads,
                    Features& features);

/// Computes angles and ORB descriptors of the features from index `first` on; earlier features must
/// have theirs. Positions are rounded to pixels of their level.
/// @param num_threads  works on levels side by side; the result does not depend on it.
/// Source:  Rublee et al., ORB, ICCV 2011, with the point pairs of cv::ORB. Ours samples its own
///          pyramid at the corner; where the patch leaves the image, the image is mirrored.
void DescribeFeatures(const ImagePyramid& pyramid,
                      int num_threads,
                      Features& features,
                      int first = 0);

/// Replaces the colours of the features from index `first` on by those of a colour image.
/// @param image  8-bit, one or three channels (BGR).
void ColourFeatures(const cv::Mat& image, Features& features, int first = 0);

/// Pyramid, detection, description and colours of a single frame.
/// @param image  8-bit, one or three channels (BGR); masked parts have no features.
/// @return  at most options.max_features features, ordered by level, row and column; none for an
/// image without corners.
Features ExtractFeatures(const MaskedImage& image,
                         FrameId frame,
                         const Camera& camera,
                         const FeatureOptions& options,
                         int num_threads);

}  // namespace rotslam
