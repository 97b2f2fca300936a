#pragma once

#include <Eigen/Core>
#include <ceres/sized_cost_function.h>

#include "rotodom/camera/camera.h"

namespace rotslam {

/// What refinement can change about a camera, as one parameter block, against the calibration:
/// focal length as a share, its aspect fy / fx as a share, principal point in focal lengths, and
/// the first two radial coefficients of the distortion as they are (k1 and k2; those of kRational's
/// numerator). Six, as a pose has: Ceres' specialised elimination wants all camera blocks of one
/// size. kFov has one coefficient, w; the last parameter then stands for nothing and is zero.
using LensParameters = Eigen::Matrix<double, 6, 1>;

/// How many coefficients of a model's distortion LensParameters holds: 1 for kFov, else 2, a
/// pinhole's zeros included.
int NumLensCoefficients(CameraModel model);

LensParameters LensOf(const Camera& camera, const Camera& calibrated);

/// `calibrated` with that lens; a pinhole that gets a distortion becomes radtan. Parameters that
/// stand for nothing are not looked at.
Camera WithLens(const Camera& calibrated, const LensParameters& lens);

/// d(pixel) / d(lens), px per unit of LensParameters.
/// @param camera  WithLens(calibrated, lens), which sees the point at `pixel`.
Eigen::Matrix<double, 2, 6> LensJacobian(const Camera& camera,
                                         const Camera& calibrated,
                                         const Eigen::Vector3d& point_in_cam,
                                         const Eigen::Vector2d& pixel);

/// (lens - expected) / sigma: what the calibration says.
class LensPriorCost final : public ceres::SizedCostFunction<6, 6> {
 public:
  /// @param sigmas  positive.
  LensPriorCost(const LensParameters& expected, const LensParameters& sigmas)
      : expected_(expected), sigmas_(sigmas) {}
  bool Evaluate(double const* const* parameters,
                double* residuals,
                double** jacobians) const override;

 private:
  LensParameters expected_;
  LensParameters sigmas_;
};

}  // namespace rotslam
