#pragma once

#include <optional>
#include <span>
#include <string>

#include <Eigen/Core>

#include "rotodom/relative_rotation/pair_arrays.h"

namespace rotslam {

/// Options of the test whether the camera has moved between two views.
struct BaselineTestOptions {
  // Of two views from one place, this share passes for views from two, at most. A smaller one asks
  // for a longer baseline.
  double false_alarm_rate = 1e-3;
  // Errors along one direction of the image may have a variance this much larger than across it, as
  // a share, beyond what the matches' covariances say: streets and rooms are full of parallel
  // edges. On rotations of rendered rooms and panoramas the share is 0.3 and 0 in the median and
  // 0.7 in one of a hundred pairs.
  double anisotropy = 0.5;
  // Part of the turn between the views that the lens' calibration may have wrong, as an error along
  // a direction. A point that is seen from d aside has moved by less where d is below this part of
  // its distance and the views are a radian apart.
  double lens_error = 0.001;

  std::optional<std::string> Problem() const;

  // Not configuration: the members that are not visited; programs and tests set them.
  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("false_alarm_rate", false_alarm_rate);
  }
};

/// Covariances of the two keypoints of a match, each in its own image.
struct KeypointCovariances {
  Eigen::Matrix2d i_px = Eigen::Matrix2d::Identity();
  Eigen::Matrix2d j_px = Eigen::Matrix2d::Identity();
};

/// Errors of image positions.
struct PixelErrors {
  double focal_px = 0.0;  // pixels per radian
  // Standard deviation of errors that neighbouring matches have in common, which may therefore
  // point along the epipolar lines.
  double shared_px = 0.0;
};

/// The best model without and with a baseline for the same matches.
struct BaselineHypotheses {
  Rotation rotation;       // j_from_i without a baseline
  EpipolarModel epipolar;  // with one
};

struct BaselineEvidence {
  // Flow along the epipolar lines in excess of that across them, relative to the latter: mean
  // squares of the clipped whitened errors. The expectation is zero without a baseline, and at most
  // eight with one.
  double excess = 0.0;
  // The part of it beyond the allowed anisotropy and shared errors, in standard deviations.
  double sigmas = 0.0;
  // `sigmas` relative to the threshold for the false-alarm rate: above one there is a baseline.
  double strength = 0.0;

  bool ShowsBaseline() const { return strength > 1.0; }
};

/// Tests whether the camera has moved between two views.
///
/// A likelihood ratio test. Without a baseline the error of a match has two dimensions. With one it
/// has the dimension across the epipolar line, and the position along the line is the depth of the
/// point. The residual sum of the rotation less that of the epipolar model is therefore the motion
/// along the lines. Whitened errors are equal in both dimensions, so that without a baseline the
/// difference equals the residual sum of the epipolar model in expectation; size and distribution
/// of the noise need not be known. The epipolar model selects the direction with the least error
/// across, so the threshold is that for the maximum over all directions.
/// @param covariances  one per pair, or none: all alike.
/// Error:   without allowances for anisotropy and shared errors, 2.5 to 3.5 % of pairs without a
///          baseline fail at a false-alarm rate of 5 %, and 1.0 to 1.3 % at 1 % (baseline tests).
/// Source:  Torr, Geometric motion segmentation and model selection, 1998, has the two models; the
///          test is ours.
BaselineEvidence TestBaseline(const PairArrays& pairs,
                              std::span<const KeypointCovariances> covariances,
                              const BaselineHypotheses& hypotheses,
                              const PixelErrors& pixels,
                              const BaselineTestOptions& options);

}  // namespace rotslam
