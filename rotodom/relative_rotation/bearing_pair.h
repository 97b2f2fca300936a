#pragma once

#include <optional>

#include <Eigen/Core>

namespace rotslam {

/// Uncertainty of a match relative to a nominal match, whose two bearings have a unit variance in
/// every direction. Only ratios between matches matter, since the unit is estimated.
struct MatchNoise {
  // Covariance of bearing_j in the plane perpendicular to it, along the columns of
  // TangentBasis(bearing_j); `TangentCovariance` makes it from one in the image.
  Eigen::Matrix2d covariance_j = Eigen::Matrix2d::Identity();
  // Variance of bearing_i, in every direction. Zero where covariance_j is the covariance of the
  // whole match, as for a patch that was tracked from view i to view j.
  double variance_i = 1.0;
};

/// The same scene point seen from two cameras: unit bearings in camera i and camera j.
struct BearingPair {
  Eigen::Vector3d bearing_i;
  Eigen::Vector3d bearing_j;
  std::optional<MatchNoise> noise = std::nullopt;  // nullopt: a nominal match
};

/// Two unit vectors that span the plane perpendicular to `direction`, as columns; with `direction`
/// they form an orthonormal basis.
Eigen::Matrix<double, 3, 2> TangentBasis(const Eigen::Vector3d& direction);

/// Propagates the covariance of an image position to its bearing.
/// @param bearing           unit, in front of the camera (z > 0).
/// @param image_covariance  2x2, of (x / z, y / z) or, the camera's distortion neglected, of
/// pixels.
/// @return  2x2 for MatchNoise::covariance_j, in the unit of `image_covariance`. Away from the
///          optical axis a unit in the image is less than one on the sphere.
Eigen::Matrix2d TangentCovariance(const Eigen::Vector3d& bearing,
                                  const Eigen::Matrix2d& image_covariance);

/// Covariance of the difference of R f_i and f_j, bearings of one point in two images: for
/// MatchNoise::covariance_j, with variance_i = 0. Six parameters: the symbols of the formula.
/// @param image_covariance_i, image_covariance_j  covariances of its two image positions.
/// @param basis_j  two orthonormal vectors perpendicular to bearing_j, as columns; those of
///                 TangentBasis for a MatchNoise.
Eigen::Matrix2d DifferenceCovariance(const Eigen::Vector3d& bearing_i,
                                     const Eigen::Matrix2d& image_covariance_i,
                                     const Eigen::Vector3d& bearing_j,
                                     const Eigen::Matrix2d& image_covariance_j,
                                     const Eigen::Matrix3d& R_j_i,
                                     const Eigen::Matrix<double, 3, 2>& basis_j);

}  // namespace rotslam
