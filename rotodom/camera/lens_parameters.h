#pragma once

#include <Eigen/Core>

#include "rotodom/camera/camera.h"

namespace rotslam {

/// The parameters of a camera that can be estimated from images, relative to a reference camera
/// (the calibration, or the camera that an estimate starts from):
///   0      focal length, as a share of the reference's fx
///   1      aspect ratio fy / fx, as a share of the reference's
///   2, 3   principal point, from the reference's, in focal lengths
///   4 - 8  the first five coefficients of the distortion, as DistortionNames(model) orders them:
///          k1 k2 p1 p2 k3, k1 k2 k3 k4, or w
///   9 - 11 unused, zero
/// Bundle adjustment takes them as two blocks of six, the size of a pose: Ceres' specialised
/// elimination wants all camera blocks of one size.
using LensParameters = Eigen::Matrix<double, 12, 1>;
inline constexpr int kLensSize = LensParameters::SizeAtCompileTime;
inline constexpr int kLensBlockSize = 6;
/// Positions in LensParameters.
inline constexpr int kLensFocal = 0;
inline constexpr int kLensAspect = 1;
inline constexpr int kLensCenter = 2;
inline constexpr int kLensDistortion = 4;
inline constexpr int kLensTangential = 6;  // two, of models that HasTangential

/// Number of distortion coefficients of a model that LensParameters holds: 5 for a pinhole, which
/// gets those of kRadtan.
int NumLensCoefficients(CameraModel model);

/// Whether coefficients of a model are tangential ones: a pinhole gets those of kRadtan.
bool HasTangential(CameraModel model);

/// Whether such coefficients of the camera are not zero.
bool IsTangential(const Camera& camera);

/// Throws nothing; parameters that the model does not have are zero.
LensParameters LensOf(const Camera& camera, const Camera& reference);

/// `reference` with that lens; a pinhole that gets a distortion becomes radtan. Parameters that the
/// model does not have are ignored.
Camera WithLens(const Camera& reference, const LensParameters& lens);

/// d(pixel) / d(lens), px per unit of LensParameters.
/// @param camera  WithLens(reference, lens), which sees the point at `pixel`.
/// Error: J equals central differences to 1e-6 of its size, for every camera model.
Eigen::Matrix<double, 2, kLensSize> LensJacobian(const Camera& camera,
                                                 const Camera& reference,
                                                 const Eigen::Vector3d& point_in_cam,
                                                 const Eigen::Vector2d& pixel);

}  // namespace rotslam
