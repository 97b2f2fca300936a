#include "rotodom/relative_rotation/baseline_evidence.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>
#include <vector>

#include <Eigen/Dense>

#include "rotodom/types/median.h"
#include "rotodom/types/options.h"

namespace rotslam {
namespace {

// Lower bound of a keypoint's standard deviation, px: interpolation and calibration limit it.
constexpr double kSmallestSigmaPx = 0.02;
// Errors count up to this many standard deviations, shared errors included, so that a few wrong
// matches or a small moving object weigh little.
constexpr double kClipSigmas = 3.0;

// Squared errors of a match in units of its covariance.
struct WhitenedErrors {
  double rotation = 0.0;  // two dimensions
  double epipolar = 0.0;  // across the line
  double shared = 0.0;    // of an error as large as the shared one, along the line
};

// Covariance of the difference of the two bearings, px^2.
Eigen::Matrix2d CovarianceOfDifference(const Eigen::Vector3d& bearing_i,
                                       const Eigen::Vector3d& bearing_j,
                                       const Eigen::Matrix3d& R_j_i,
                                       const Eigen::Matrix<double, 3, 2>& basis_j,
                                       const KeypointCovariances& covariances) {
  const Eigen::Matrix2d floor = kSmallestSigmaPx * kSmallestSigmaPx * Eigen::Matrix2d::Identity();
  return DifferenceCovariance(
             bearing_i, covariances.i_px, bearing_j, covariances.j_px, R_j_i, basis_j) +
         floor;
}

class Whitening {
 public:
  Whitening(const BaselineHypotheses& hypotheses, double shared_error_rad, double focal_px)
      : rotation_(hypotheses.rotation.Matrix()),
        epipolar_(hypotheses.epipolar.j_from_i.Matrix()),
        direction_(hypotheses.epipolar.direction),
        squared_shared_(shared_error_rad * shared_error_rad),
        squared_pixel_(1.0 / (focal_px * focal_px)) {}

  WhitenedErrors operator()(const Eigen::Vector3d& bearing_i,
                            const Eigen::Vector3d& bearing_j,
                            const KeypointCovariances* covariances) const {
    // Across the epipolar line and along it.
    Eigen::Matrix<double, 3, 2> basis;
    basis.col(0) = direction_.cross(bearing_j).normalized();
    basis.col(1) = bearing_j.cross(basis.col(0));
    const Eigen::Matrix2d C =
        squared_pixel_ *
        (covariances == nullptr
             ? Eigen::Matrix2d(2.0 * Eigen::Matrix2d::Identity())
             : CovarianceOfDifference(bearing_i, bearing_j, rotation_, basis, *covariances));
    const Eigen::Vector2d of_rotation = basis.transpose() * (rotation_ * bearing_i - bearing_j);
    const double distance = basis.col(0).dot(epipolar_ * bearing_i - bearing_j);
    const Eigen::Matrix2d information = C.inverse();
    return {of_rotation.dot(information * of_rotation),
            distance * distance / C(0, 0),
            squared_shared_ * information(1, 1)};
  }

 private:
  Eigen::Matrix3d rotation_;
  Eigen::Matrix3d epipolar_;
  Eigen::Vector3d direction_;
  double squared_shared_;
  double squared_pixel_;
};

// Robust variance of the one-dimensional errors across the lines.
double VarianceAcross(const std::vector<WhitenedErrors>& errors) {
  std::vector<double> squares;
  squares.reserve(errors.size());
  for (const WhitenedErrors& error : errors) squares.push_back(error.epipolar);
  return kSigmasPerMedianDeviation * kSigmasPerMedianDeviation * Median(std::move(squares));
}

// Threshold for the maximum over all directions, in standard deviations: the quantile of a
// chi-square variable with four degrees of freedom. The directions are a family of two parameters;
// for translations in the image plane alone two degrees would be exact.
double CriticalSigmas(double false_alarm_rate) {
  double low = 0.0;
  double high = 1e3;
  while (high - low > 1e-9 * high) {
    const double half = 0.5 * (low + high);  // of the square
    ((1.0 + half) * std::exp(-half) > false_alarm_rate ? low : high) = half;
  }
  return std::sqrt(2.0 * high);
}

}  // namespace

std::optional<std::string> BaselineTestOptions::Problem() const {
  if (!(false_alarm_rate > 0.0 && false_alarm_rate < 1.0)) {
    return OutOfRange("false_alarm_rate", false_alarm_rate, "between 0 and 1");
  }
  if (!(anisotropy >= 0.0)) return OutOfRange("anisotropy", anisotropy, "zero or more");
  if (!(lens_error >= 0.0)) return OutOfRange("lens_error", lens_error, "zero or more");
  return std::nullopt;
}

BaselineEvidence TestBaseline(const PairArrays& pairs,
                              std::span<const KeypointCovariances> covariances,
                              const BaselineHypotheses& hypotheses,
                              const PixelErrors& pixels,
                              const BaselineTestOptions& options) {
  if (!covariances.empty() && std::ssize(covariances) != pairs.size()) {
    throw std::invalid_argument("TestBaseline: not one covariance per pair");
  }
  if (pairs.size() == 0) return {};
  const double lens_error = options.lens_error * hypotheses.rotation.Angle();
  const Whitening whiten(
      hypotheses, std::hypot(pixels.shared_px / pixels.focal_px, lens_error), pixels.focal_px);
  std::vector<WhitenedErrors> errors;
  errors.reserve(pairs.size());
  for (int k = 0; k < pairs.size(); ++k) {
    errors.push_back(whiten(
        pairs.BearingI(k), pairs.BearingJ(k), covariances.empty() ? nullptr : &covariances[k]));
  }

  const double variance = VarianceAcross(errors);
  const double squared_clip = kClipSigmas * kClipSigmas;
  double across = 0.0;
  double sum = 0.0;
  double squares = 0.0;
  double shared = 0.0;
  for (const WhitenedErrors& error : errors) {
    const double of_line = std::min(error.epipolar, squared_clip * variance);
    // The clipping limit includes the shared error, so that evidence beyond it is not clipped.
    const double limit = squared_clip * (variance + error.shared);
    const double beyond = std::clamp(error.rotation - error.epipolar, -limit, limit) - of_line;
    across += of_line;
    sum += beyond;
    squares += beyond * beyond;
    shared += error.shared;
  }
  const double n = static_cast<double>(pairs.size());
  // Exact matches have no noise from which a scale could be estimated.
  if (!(across > 0.0)) return {};
  const double mean = sum / n;
  // Bias by the unknowns of the epipolar fit, in degrees of freedom: it reduces the errors of that
  // model only.
  constexpr double kFitted = 7.0;
  const double allowed = ((options.anisotropy + kFitted / n) * across + shared) / n;
  const double spread = std::max(squares / n - mean * mean, 1e-12 * variance * variance);
  const double sigma = std::sqrt(spread / n);
  BaselineEvidence evidence;
  evidence.excess = sum / across;
  evidence.sigmas = (mean - allowed) / sigma;
  evidence.strength = evidence.sigmas / CriticalSigmas(options.false_alarm_rate);
  return evidence;
}

}  // namespace rotslam
