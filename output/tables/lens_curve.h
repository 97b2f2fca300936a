#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "rotodom/camera/camera.h"
#include "rotodom/camera/lens_parameters.h"

namespace rotslam {

/// Distance from the principal point at which a lens shows a ray of that angle to its axis, px, by
/// the focal length fx and the radial terms alone; nullopt where it does not reach.
std::optional<double> LensRadius(const Camera& camera, double angle_rad);

/// One point of the curve that a lens is: the angle of a ray and where it is shown.
struct LensCurvePoint {
  double angle_rad = 0.0;
  double radius_px = 0.0;  // LensRadius
  double sigma_px = 0.0;   // its standard deviation
};

/// Steps of the curve in the summary of a run.
inline constexpr int kLensCurveSteps = 8;

using CurveCovariance = Eigen::Matrix<double, kLensSize, kLensSize>;

/// The curve at equal steps of the radius, the last one at half of the image's diagonal; shorter
/// where the lens does not reach.
/// @param covariance  of LensParameters, relative to `camera`.
std::vector<LensCurvePoint> LensCurve(const Camera& camera,
                                      const CurveCovariance& covariance,
                                      int num_steps);

}  // namespace rotslam
