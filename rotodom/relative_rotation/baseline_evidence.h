#pragma once

#include <optional>
#include <span>
#include <string>

#include <Eigen/Core>

#include "rotodom/relative_rotation/pair_arrays.h"

namespace rotslam {

/// Of the test whether the camera has moved between two views.
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

/// How well the two keypoints of a match are known, each in its own image.
struct KeypointCovariances {
  Eigen::Matrix2d i_px = Eigen::Matrix2d::Identity();
  Eigen::Matrix2d j_px = Eigen::Matrix2d::Identity();
};

/// Two hypotheses about the same matches at their best.
struct BaselineHypotheses {
  Rotation rotation;       // j_from_i without a baseline
  EpipolarModel epipolar;  // with one
};

struct BaselineEvidence {
  // Flow along the epipolar lines in excess of the flow across them, mean square of the clipped
  // whitened errors, as a share of the latter. Zero in expectation without a baseline, up to eight
  // with one.
  double excess = 0.0;
  // What of it is beyond the allowed anisotropy and shared errors, in standard deviations.
  double sigmas = 0.0;
  // sigmas as a share of what the false-alarm rate asks for: above one, there is a baseline.
  double strength = 0.0;

  bool ShowsBaseline() const { return strength > 1.0; }
};

/// Tests whether the matches of two views show that the views are from two places.
///
/// A ratio of likelihoods: without a baseline the error of a match has two dimensions, with one it
/// has the one across its epipolar line, and the position along the line is the point's depth. So
/// the residual sum of the rotation less that of the epipolar model is what moves along the lines.
/// Errors are the same in both dimensions once whitened, so without a baseline that sum equals the
/// residual sum of the epipolar model in expectation, whatever the noise: nobody has to know its
/// size or distribution. The epipolar model takes the direction in which there is least error
/// across; the threshold is for the largest of all directions.
/// @param covariances      one per pair, or none: all alike.
/// @param shared_error_px  standard deviation of errors that neighbouring matches have in common,
///                         which may therefore point along the lines.
/// @param focal_px         pixels per radian.
/// Error:   without allowances (anisotropy, shared errors), of pairs of views from one place 2.5 to
///          3.5 % show a baseline where 5 % are asked for and 1.0 to 1.3 % where 1 % are (100 and
///          400 matches, 0.05 and 0.5 px; 400 scenes each).
/// Source:  Torr, Geometric motion segmentation and model selection, 1998, has the two models; the
///          test is ours.
BaselineEvidence TestBaseline(const PairArrays& pairs,
                              std::span<const KeypointCovariances> covariances,
                              const BaselineHypotheses& hypotheses,
                              double shared_error_px,
                              double focal_px,
                              const BaselineTestOptions& options);

}  // namespace rotslam
