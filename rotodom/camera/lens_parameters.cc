#include "rotodom/camera/lens_parameters.h"

#include <algorithm>
#include <cmath>

namespace rotslam {
namespace {

// d(d(r) / r) / dw of kFov, d(r) = atan(a r) / w with a = 2 tan(w / 2).
double FovSlope(double w, double r) {
  // Short of it the terms cancel to less than their series, 1 + w^2 (1 / 12 - r^2 / 3), leaves out.
  constexpr double kSmall = 1e-8;
  const double s = r * r;
  if (w * w * (1.0 + s) < kSmall) return 2.0 * w * (1.0 / 12.0 - s / 3.0);
  const double a = 2.0 * std::tan(0.5 * w);
  const double factor = r > 0.0 ? std::atan(a * r) / (w * r) : a / w;
  return ((1.0 + 0.25 * a * a) / (1.0 + a * a * s) - factor) / w;
}

}  // namespace

int NumLensCoefficients(CameraModel model) {
  constexpr int kMost = 5;
  if (model == CameraModel::kPinhole) return kMost;
  return std::min(kMost, static_cast<int>(DistortionNames(model).size()));
}

bool HasTangential(CameraModel model) {
  return model != CameraModel::kEquidistant && model != CameraModel::kFov;
}

bool IsTangential(const Camera& camera) {
  return HasTangential(camera.model) &&
         !LensOf(camera, camera).segment<2>(kLensTangential).isZero(0.0);
}

LensParameters LensOf(const Camera& camera, const Camera& reference) {
  LensParameters lens = LensParameters::Zero();
  lens[kLensFocal] = camera.fx / reference.fx;
  lens[kLensAspect] = camera.fy / reference.fy * reference.fx / camera.fx;
  lens[kLensCenter] = (camera.cx - reference.cx) / reference.fx;
  lens[kLensCenter + 1] = (camera.cy - reference.cy) / reference.fy;
  std::copy_n(camera.distortion.begin(), NumLensCoefficients(camera.model), &lens[kLensDistortion]);
  return lens;
}

Camera WithLens(const Camera& reference, const LensParameters& lens) {
  Camera result = reference;
  result.fx = reference.fx * lens[kLensFocal];
  result.fy = reference.fy * lens[kLensFocal] * lens[kLensAspect];
  result.cx = reference.cx + reference.fx * lens[kLensCenter];
  result.cy = reference.cy + reference.fy * lens[kLensCenter + 1];
  const double* coefficients = &lens[kLensDistortion];
  const int num_coefficients = NumLensCoefficients(reference.model);
  std::copy_n(coefficients, num_coefficients, result.distortion.begin());
  const bool is_distorted = std::any_of(
      coefficients, coefficients + num_coefficients, [](double value) { return value != 0.0; });
  if (is_distorted && result.model == CameraModel::kPinhole) result.model = CameraModel::kRadtan;
  return result;
}

Eigen::Matrix<double, 2, kLensSize> LensJacobian(const Camera& camera,
                                                 const Camera& reference,
                                                 const Eigen::Vector3d& point_in_cam,
                                                 const Eigen::Vector2d& pixel) {
  // The distortion's radius and its direction: x (1 + k1 r^2 + k2 r^4) and likewise y, over a
  // denominator for kRational.
  const double r = point_in_cam.head<2>().norm();
  Eigen::Vector2d axis = point_in_cam.head<2>() / point_in_cam.z();
  double radius = axis.norm();
  if (camera.model == CameraModel::kEquidistant) {
    radius = std::atan2(r, point_in_cam.z());
    axis = r > 0.0 ? Eigen::Vector2d(radius / r * point_in_cam.head<2>()) : Eigen::Vector2d::Zero();
  }
  const double s = radius * radius;
  const auto& d = camera.distortion;
  const Eigen::Vector2d by_radius(camera.fx * axis.x(), camera.fy * axis.y());
  const Eigen::Vector2d from_center = pixel - Eigen::Vector2d(camera.cx, camera.cy);
  Eigen::Matrix<double, 2, kLensSize> J = Eigen::Matrix<double, 2, kLensSize>::Zero();
  J.col(kLensFocal) = from_center * (reference.fx / camera.fx);
  J(1, kLensAspect) = from_center.y() * (reference.fy * camera.fx) / (camera.fy * reference.fx);
  J(0, kLensCenter) = reference.fx;
  J(1, kLensCenter + 1) = reference.fy;
  auto by_coefficients = J.middleCols<5>(kLensDistortion);
  if (camera.model == CameraModel::kFov) {
    by_coefficients.col(0) = FovSlope(d[0], radius) * by_radius;
  } else if (camera.model == CameraModel::kEquidistant) {
    by_coefficients.col(0) = s * by_radius;
    by_coefficients.col(1) = s * s * by_radius;
    by_coefficients.col(2) = s * s * s * by_radius;
    by_coefficients.col(3) = s * s * s * s * by_radius;
  } else {
    const bool is_rational = camera.model == CameraModel::kRational;
    const double share = is_rational ? 1.0 / (1.0 + s * (d[5] + s * (d[6] + s * d[7]))) : 1.0;
    const double x = axis.x();
    const double y = axis.y();
    by_coefficients.col(0) = s * share * by_radius;
    by_coefficients.col(1) = s * s * share * by_radius;
    by_coefficients.col(2) << camera.fx * 2.0 * x * y, camera.fy * (s + 2.0 * y * y);
    by_coefficients.col(3) << camera.fx * (s + 2.0 * x * x), camera.fy * 2.0 * x * y;
    by_coefficients.col(4) = s * s * s * share * by_radius;
  }
  return J;
}

}  // namespace rotslam
