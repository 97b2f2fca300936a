#include "output/export/lens_fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <utility>
#include <vector>

#include <Eigen/Dense>

namespace rotslam {
namespace {

constexpr int kGridColumns = 33;
constexpr int kGridRows = 25;
constexpr int kMaxSteps = 100;
// A ray that a model cannot show counts as so far away, in pixels, so that steps that lose rays are
// refused.
constexpr double kLostPx = 1e4;

struct GridRay {
  Eigen::Vector2d pixel;
  Eigen::Vector3d bearing;
};

std::vector<GridRay> RaysOf(const Camera& camera) {
  std::vector<GridRay> rays;
  for (int row = 0; row < kGridRows; ++row) {
    for (int column = 0; column < kGridColumns; ++column) {
      const Eigen::Vector2d pixel(column * (camera.width - 1.0) / (kGridColumns - 1),
                                  row * (camera.height - 1.0) / (kGridRows - 1));
      if (const auto bearing = camera.Unproject(pixel)) rays.push_back({pixel, *bearing});
    }
  }
  return rays;
}

// The unknowns: fx, fy, cx, cy and the first coefficients.
Eigen::VectorXd UnknownsOf(const Camera& camera, int num_coefficients) {
  Eigen::VectorXd unknowns(4 + num_coefficients);
  unknowns.head<4>() << camera.fx, camera.fy, camera.cx, camera.cy;
  for (int k = 0; k < num_coefficients; ++k) unknowns[4 + k] = camera.distortion[k];
  return unknowns;
}

Camera WithUnknowns(Camera camera, const Eigen::VectorXd& unknowns) {
  camera.fx = unknowns[0];
  camera.fy = unknowns[1];
  camera.cx = unknowns[2];
  camera.cy = unknowns[3];
  for (int k = 4; k < unknowns.size(); ++k) camera.distortion[k - 4] = unknowns[k];
  return camera;
}

Eigen::VectorXd ResidualsOf(const Camera& camera, const std::vector<GridRay>& rays) {
  Eigen::VectorXd residuals(2 * static_cast<Eigen::Index>(rays.size()));
  for (std::size_t k = 0; k < rays.size(); ++k) {
    const auto pixel = camera.Project(rays[k].bearing);
    residuals.segment<2>(2 * static_cast<Eigen::Index>(k)) =
        pixel ? Eigen::Vector2d(*pixel - rays[k].pixel) : Eigen::Vector2d(kLostPx, kLostPx);
  }
  return residuals;
}

Eigen::MatrixXd JacobianAt(const Camera& camera,
                           const Eigen::VectorXd& unknowns,
                           const std::vector<GridRay>& rays) {
  Eigen::MatrixXd J(2 * static_cast<Eigen::Index>(rays.size()), unknowns.size());
  for (int k = 0; k < unknowns.size(); ++k) {
    const double step = 1e-6 * std::max(1.0, std::abs(unknowns[k]));
    Eigen::VectorXd up = unknowns;
    Eigen::VectorXd down = unknowns;
    up[k] += step;
    down[k] -= step;
    J.col(k) = (ResidualsOf(WithUnknowns(camera, up), rays) -
                ResidualsOf(WithUnknowns(camera, down), rays)) /
               (2.0 * step);
  }
  // Rays lost on one side of a step have no derivative.
  J = (J.array().abs() < 1e8).select(J, 0.0);
  return J;
}

Camera Minimise(const Camera& start, int num_coefficients, const std::vector<GridRay>& rays) {
  Eigen::VectorXd unknowns = UnknownsOf(start, num_coefficients);
  Eigen::VectorXd residuals = ResidualsOf(start, rays);
  double damping = 1e-4;
  for (int step = 0; step < kMaxSteps && damping < 1e12; ++step) {
    const Eigen::MatrixXd J = JacobianAt(start, unknowns, rays);
    Eigen::MatrixXd normal = J.transpose() * J;
    normal.diagonal() += damping * (normal.diagonal().array() + 1e-12).matrix();
    const Eigen::VectorXd update = normal.ldlt().solve(J.transpose() * residuals);
    const Eigen::VectorXd next = unknowns - update;
    const Camera camera = WithUnknowns(start, next);
    if (!next.allFinite() || camera.Problem()) {
      damping *= 10.0;
      continue;
    }
    const Eigen::VectorXd next_residuals = ResidualsOf(camera, rays);
    const double gain = residuals.squaredNorm() - next_residuals.squaredNorm();
    if (gain < 0.0) {
      damping *= 10.0;
      continue;
    }
    const bool is_done = gain <= 1e-14 * residuals.squaredNorm();
    unknowns = next;
    residuals = next_residuals;
    damping = std::max(1e-12, 0.1 * damping);
    if (is_done) break;
  }
  return WithUnknowns(start, unknowns);
}

LensFit Measure(const Camera& fitted, const std::vector<GridRay>& rays) {
  LensFit fit;
  fit.camera = fitted;
  double sum = 0.0;
  for (const GridRay& ray : rays) {
    const auto pixel = fitted.Project(ray.bearing);
    const double error_px =
        pixel ? (*pixel - ray.pixel).norm() : std::numeric_limits<double>::infinity();
    sum += error_px * error_px;
    fit.largest_px = std::max(fit.largest_px, error_px);
  }
  fit.rms_px = rays.empty() ? 0.0 : std::sqrt(sum / static_cast<double>(rays.size()));
  return fit;
}

}  // namespace

LensFit FitLens(const Camera& camera, CameraModel model, int num_coefficients) {
  const std::vector<GridRay> rays = RaysOf(camera);
  Camera start = camera;
  start.model = model;
  start.distortion = {};
  LensFit best = Measure(Minimise(start, num_coefficients, rays), rays);
  const auto is_polynomial = [](CameraModel of) {
    return of == CameraModel::kRadtan || of == CameraModel::kRational;
  };
  if (!is_polynomial(camera.model) || !is_polynomial(model)) return best;
  // The coefficients that both have are the better start, where the lens has no denominator.
  std::copy_n(camera.distortion.begin(), num_coefficients, start.distortion.begin());
  LensFit other = Measure(Minimise(start, num_coefficients, rays), rays);
  return other.rms_px < best.rms_px ? other : best;
}

std::string DescribeResidual(const LensFit& fit) {
  std::array<char, 96> text = {};
  std::snprintf(text.data(),
                text.size(),
                "%.2g px root mean square, %.2g px at most",
                fit.rms_px,
                fit.largest_px);
  return text.data();
}

}  // namespace rotslam
