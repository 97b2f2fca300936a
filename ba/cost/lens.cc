#include "ba/cost/lens.h"

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

int NumLensCoefficients(CameraModel model) { return model == CameraModel::kFov ? 1 : 2; }

LensParameters LensOf(const Camera& camera, const Camera& calibrated) {
  LensParameters lens;
  lens << camera.fx / calibrated.fx, camera.fy / calibrated.fy * calibrated.fx / camera.fx,
      (camera.cx - calibrated.cx) / calibrated.fx, (camera.cy - calibrated.cy) / calibrated.fy,
      camera.distortion[0], NumLensCoefficients(camera.model) > 1 ? camera.distortion[1] : 0.0;
  return lens;
}

Camera WithLens(const Camera& calibrated, const LensParameters& lens) {
  Camera result = calibrated;
  result.fx = calibrated.fx * lens[0];
  result.fy = calibrated.fy * lens[0] * lens[1];
  result.cx = calibrated.cx + calibrated.fx * lens[2];
  result.cy = calibrated.cy + calibrated.fy * lens[3];
  result.distortion[0] = lens[4];
  if (NumLensCoefficients(result.model) > 1) result.distortion[1] = lens[5];
  const bool bends = lens[4] != 0.0 || lens[5] != 0.0;
  if (bends && result.model == CameraModel::kPinhole) result.model = CameraModel::kRadtan;
  return result;
}

Eigen::Matrix<double, 2, 6> LensJacobian(const Camera& camera,
                                         const Camera& calibrated,
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
  double by_k1 = s;
  double by_k2 = s * s;
  if (camera.model == CameraModel::kRational) {
    const double denominator = 1.0 + s * (d[5] + s * (d[6] + s * d[7]));
    by_k1 /= denominator;
    by_k2 /= denominator;
  } else if (camera.model == CameraModel::kFov) {
    by_k1 = FovSlope(d[0], radius);
    by_k2 = 0.0;
  }
  const Eigen::Vector2d by_radius(camera.fx * axis.x(), camera.fy * axis.y());
  const Eigen::Vector2d from_center = pixel - Eigen::Vector2d(camera.cx, camera.cy);
  Eigen::Matrix<double, 2, 6> J;
  J.col(0) = from_center * (calibrated.fx / camera.fx);
  J.col(1) << 0.0, from_center.y() * (calibrated.fy * camera.fx) / (camera.fy * calibrated.fx);
  J.col(2) << calibrated.fx, 0.0;
  J.col(3) << 0.0, calibrated.fy;
  J.col(4) = by_k1 * by_radius;
  J.col(5) = by_k2 * by_radius;
  return J;
}

bool LensPriorCost::Evaluate(double const* const* parameters,
                             double* residuals,
                             double** jacobians) const {
  const Eigen::Map<const LensParameters> lens(parameters[0]);
  Eigen::Map<LensParameters> residual(residuals);
  residual = (lens - expected_).cwiseQuotient(sigmas_);
  if (jacobians != nullptr && jacobians[0] != nullptr) {
    Eigen::Map<Eigen::Matrix<double, 6, 6, Eigen::RowMajor>> J(jacobians[0]);
    J = sigmas_.cwiseInverse().asDiagonal();
  }
  return true;
}

}  // namespace rotslam
