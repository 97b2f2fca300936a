#include "output/tables/lens_curve.h"

#include <algorithm>
#include <cmath>

namespace rotslam {
namespace {

// Its radial terms, about the origin.
Camera RadialPart(Camera camera) {
  camera.cx = camera.cy = 0.0;
  camera.fy = camera.fx;
  if (camera.model == CameraModel::kRadtan || camera.model == CameraModel::kRational) {
    camera.distortion[2] = camera.distortion[3] = 0.0;
  }
  return camera;
}

}  // namespace

std::optional<double> LensRadius(const Camera& camera, double angle_rad) {
  const Eigen::Vector3d ray(std::sin(angle_rad), 0.0, std::cos(angle_rad));
  const std::optional<Eigen::Vector2d> pixel = RadialPart(camera).Project(ray);
  if (!pixel) return std::nullopt;
  return pixel->x();
}

std::vector<LensCurvePoint> LensCurve(const Camera& camera,
                                      const CurveCovariance& covariance,
                                      int num_steps) {
  const Camera radial = RadialPart(camera);
  const double end_px = 0.5 * std::hypot(camera.width, camera.height);
  std::vector<LensCurvePoint> curve;
  for (int step = 1; step <= num_steps; ++step) {
    const Eigen::Vector2d pixel(end_px * step / num_steps, 0.0);
    const auto ray = radial.Unproject(pixel);
    if (!ray) break;
    LensParameters by_lens = LensJacobian(radial, radial, *ray, pixel).row(0).transpose();
    by_lens[kLensCenter] = 0.0;
    curve.push_back({std::atan2(ray->x(), ray->z()),
                     pixel.x(),
                     std::sqrt(std::max(0.0, by_lens.dot(covariance * by_lens)))});
  }
  return curve;
}

}  // namespace rotslam
