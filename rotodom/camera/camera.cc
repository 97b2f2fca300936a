#include "rotodom/camera/camera.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <sstream>

#include <Eigen/Geometry>
#include <Eigen/LU>

namespace rotslam {
namespace {

// Newton stops here; what it must reach to count, relative to 1 + |target|, in normalised image
// units. 1e-12 is 1e-9 px at a focal length of 1000 px.
constexpr double kResidualGoal = 1e-15;
constexpr double kResidualLimit = 2e-13;
constexpr int kMaxNewtonSteps = 30;
// tan of the largest angle off the axis that Unproject answers for kRadtan: 89.994 deg.
constexpr double kMaxRadius = 1e4;

// Odd distortion polynomial d(t) = t (1 + a0 t^2 + a1 t^4 + a2 t^6 + a3 t^8): the radius for
// kRadtan, the angle off the axis for kEquidistant.
class OddPolynomial {
 public:
  explicit OddPolynomial(const Camera& camera) {
    const auto& k = camera.distortion;
    if (camera.model == CameraModel::kRadtan) a_ = {k[0], k[1], k[4], 0.0};
    if (camera.model == CameraModel::kEquidistant) a_ = {k[0], k[1], k[2], k[3]};
  }

  // d(t) / t as a function of s = t^2, and its derivative by s.
  double Factor(double s) const {
    return 1.0 + s * (a_[0] + s * (a_[1] + s * (a_[2] + s * a_[3])));
  }
  double FactorSlope(double s) const {
    return a_[0] + s * (2.0 * a_[1] + s * (3.0 * a_[2] + s * 4.0 * a_[3]));
  }
  double Value(double t) const { return t * Factor(t * t); }
  double Slope(double t) const { return Factor(t * t) + 2.0 * t * t * FactorSlope(t * t); }

  // Whether d' > 0 on all of [0, t]: nothing up to t lies beyond the fold. d' is a quartic in
  // s = t^2; it is positive where its Bernstein coefficients are, else both halves are asked.
  bool IncreasesUpTo(double t) const {
    if (a_ == std::array<double, 4>{}) return true;
    const double s = t * t;
    const double c1 = 3.0 * a_[0] * s;
    const double c2 = 5.0 * a_[1] * s * s;
    const double c3 = 7.0 * a_[2] * s * s * s;
    const double c4 = 9.0 * a_[3] * s * s * s * s;
    // Far from the fold its terms cannot come to -1 together.
    if (std::abs(c1) + std::abs(c2) + std::abs(c3) + std::abs(c4) < 0.5) return true;
    return Positive({1.0,
                     1.0 + c1 / 4.0,
                     1.0 + c1 / 2.0 + c2 / 6.0,
                     1.0 + 3.0 * c1 / 4.0 + c2 / 2.0 + c3 / 4.0,
                     1.0 + c1 + c2 + c3 + c4},
                    0);
  }

  // The t in [0, max] with d(t) == value on the branch that starts at zero, or, when the fold or
  // `max` comes first, the place where the branch ends. Bisection to the last bit.
  double SolveOnFirstBranch(double value, double max) const {
    double low = 0.0;
    double high = max;
    for (int k = 0; k < 100; ++k) {
      const double middle = 0.5 * (low + high);
      (IncreasesUpTo(middle) && Value(middle) < value ? low : high) = middle;
    }
    return low;
  }

 private:
  using Bernstein = std::array<double, 5>;

  static bool Positive(const Bernstein& b, int depth) {
    if (!(b.front() > 0.0 && b.back() > 0.0)) return false;
    if (b[1] > 0.0 && b[2] > 0.0 && b[3] > 0.0) return true;
    if (depth == 30) return false;  // touches zero within rounding
    Bernstein left;
    Bernstein right = b;
    for (int level = 0; level < 5; ++level) {  // de Casteljau at one half
      left[level] = right[0];
      for (int k = 0; k + level < 4; ++k) right[k] = 0.5 * (right[k] + right[k + 1]);
    }
    return Positive(left, depth + 1) && Positive(right, depth + 1);
  }

  std::array<double, 4> a_ = {};
};

// Radial and tangential distortion of a point of the plane z = 1.
Eigen::Vector2d DistortRadtan(const Camera& camera,
                              const OddPolynomial& radial,
                              const Eigen::Vector2d& point,
                              Eigen::Matrix2d& J) {
  const double x = point.x();
  const double y = point.y();
  const double p1 = camera.distortion[2];
  const double p2 = camera.distortion[3];
  const double s = point.squaredNorm();
  const double factor = radial.Factor(s);
  const double slope = 2.0 * radial.FactorSlope(s);
  J(0, 0) = factor + slope * x * x + 2.0 * p1 * y + 6.0 * p2 * x;
  J(0, 1) = slope * x * y + 2.0 * p1 * x + 2.0 * p2 * y;
  J(1, 0) = J(0, 1);
  J(1, 1) = factor + slope * y * y + 6.0 * p1 * y + 2.0 * p2 * x;
  return {x * factor + 2.0 * p1 * x * y + p2 * (s + 2.0 * x * x),
          y * factor + p1 * (s + 2.0 * y * y) + 2.0 * p2 * x * y};
}

// Solves DistortRadtan(p) == target from `start`; every step is halved until it helps.
std::optional<Eigen::Vector2d> NewtonRadtan(const Camera& camera,
                                            const OddPolynomial& radial,
                                            const Eigen::Vector2d& target,
                                            Eigen::Vector2d point) {
  const double unit = 1.0 + target.norm();
  Eigen::Matrix2d J;
  Eigen::Vector2d residual = target - DistortRadtan(camera, radial, point, J);
  for (int k = 0; k < kMaxNewtonSteps && residual.norm() > kResidualGoal * unit; ++k) {
    const double det = J.determinant();
    if (!(det > 0.0)) return std::nullopt;
    Eigen::Vector2d step = J.inverse() * residual;
    bool better = false;
    for (int halving = 0; halving < 12 && !better; ++halving, step *= 0.5) {
      Eigen::Matrix2d J_next;
      const Eigen::Vector2d next = point + step;
      const Eigen::Vector2d r_next = target - DistortRadtan(camera, radial, next, J_next);
      better = r_next.norm() < residual.norm();
      if (!better) continue;
      point = next;
      residual = r_next;
      J = J_next;
    }
    if (!better) break;  // rounding, or stuck: the residual tells
  }
  const bool solved = residual.norm() <= kResidualLimit * unit;
  if (!solved || !(J.determinant() > 0.0) || !radial.IncreasesUpTo(point.norm())) {
    return std::nullopt;
  }
  return point;
}

std::optional<Eigen::Vector2d> UndistortRadtan(const Camera& camera,
                                               const Eigen::Vector2d& distorted) {
  const OddPolynomial radial(camera);
  if (auto point = NewtonRadtan(camera, radial, distorted, distorted)) return point;
  // Near the fold, or across a second branch: start from the radial part alone, solved exactly.
  const double radius = distorted.norm();
  const double start = radial.SolveOnFirstBranch(radius, kMaxRadius);
  return NewtonRadtan(camera, radial, distorted, distorted * (start / radius));
}

// The angle off the axis, at most pi, whose distorted value is `distorted`.
std::optional<double> UndistortAngle(const OddPolynomial& polynomial, double distorted) {
  const double unit = 1.0 + distorted;
  const auto solve_from = [&](double theta) -> std::optional<double> {
    double residual = distorted - polynomial.Value(theta);
    for (int k = 0; k < kMaxNewtonSteps && std::abs(residual) > kResidualGoal * unit; ++k) {
      const double next = theta + residual / polynomial.Slope(theta);
      const double next_residual = distorted - polynomial.Value(next);
      if (!(std::abs(next_residual) < std::abs(residual))) break;
      theta = next;
      residual = next_residual;
    }
    if (!(std::abs(residual) <= kResidualLimit * unit) || theta < 0.0 || theta > std::numbers::pi ||
        !polynomial.IncreasesUpTo(theta)) {
      return std::nullopt;
    }
    return theta;
  };
  if (const auto theta = solve_from(std::min(distorted, 0.5 * std::numbers::pi))) return theta;
  return solve_from(polynomial.SolveOnFirstBranch(distorted, std::numbers::pi));
}

std::optional<Eigen::Vector2d> ProjectRadtan(const Camera& camera,
                                             const Eigen::Vector3d& point_in_cam,
                                             Eigen::Matrix<double, 2, 3>* J) {
  if (!(point_in_cam.z() > 0.0)) return std::nullopt;
  const OddPolynomial radial(camera);
  const double inverse_depth = 1.0 / point_in_cam.z();
  const Eigen::Vector2d plane = point_in_cam.head<2>() * inverse_depth;
  if (!radial.IncreasesUpTo(plane.norm())) return std::nullopt;
  Eigen::Matrix2d J_distort;
  const Eigen::Vector2d distorted = DistortRadtan(camera, radial, plane, J_distort);
  if (!distorted.allFinite() || !(J_distort.determinant() > 0.0)) return std::nullopt;
  if (J != nullptr) {
    J->leftCols<2>() = J_distort * inverse_depth;
    J->col(2) = -(J->leftCols<2>() * plane);
    J->row(0) *= camera.fx;
    J->row(1) *= camera.fy;
  }
  return distorted;
}

std::optional<Eigen::Vector2d> ProjectEquidistant(const Camera& camera,
                                                  const Eigen::Vector3d& point_in_cam,
                                                  Eigen::Matrix<double, 2, 3>* J) {
  const Eigen::Vector2d xy = point_in_cam.head<2>();
  const double z = point_in_cam.z();
  const double r = xy.norm();
  const double squared_distance = r * r + z * z;
  if (!(squared_distance > 0.0) || !std::isfinite(squared_distance)) return std::nullopt;
  if (r <= 1e-12 * std::abs(z)) {  // on the axis: a pinhole to first order, or straight behind
    if (z < 0.0) return std::nullopt;
    if (J != nullptr) {
      *J << camera.fx / z, 0.0, -camera.fx * xy.x() / (z * z),  //
          0.0, camera.fy / z, -camera.fy * xy.y() / (z * z);
    }
    return xy / z;
  }
  const OddPolynomial polynomial(camera);
  const double theta = std::atan2(r, z);
  if (!polynomial.IncreasesUpTo(theta)) return std::nullopt;
  const double scale = polynomial.Value(theta) / r;
  if (J != nullptr) {
    // d theta / d xy = (z / |p|^2) xy / r and d theta / dz = -r / |p|^2.
    const double slope = polynomial.Slope(theta);
    const double along = slope * z / squared_distance;
    const Eigen::Vector2d direction = xy / r;
    J->leftCols<2>() =
        scale * Eigen::Matrix2d::Identity() + (along - scale) * direction * direction.transpose();
    J->col(2) = -slope / squared_distance * xy;
    J->row(0) *= camera.fx;
    J->row(1) *= camera.fy;
  }
  return scale * xy;
}

}  // namespace

const char* Name(CameraModel model) {
  switch (model) {
    case CameraModel::kPinhole:
      return "pinhole";
    case CameraModel::kRadtan:
      return "radtan";
    case CameraModel::kEquidistant:
      return "equidistant";
    case CameraModel::kRational:
      return "rational";
    case CameraModel::kFov:
      return "fov";
  }
  return "unknown";
}

std::span<const CameraModel> AllCameraModels() {
  static constexpr CameraModel kAll[] = {CameraModel::kPinhole,
                                         CameraModel::kRadtan,
                                         CameraModel::kEquidistant,
                                         CameraModel::kRational,
                                         CameraModel::kFov};
  return kAll;
}

std::optional<CameraModel> FindCameraModel(const std::string& name) {
  for (const CameraModel model : AllCameraModels()) {
    if (name == Name(model)) return model;
  }
  return std::nullopt;
}

std::span<const char* const> DistortionNames(CameraModel model) {
  static constexpr const char* kRational[] = {"k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"};
  static constexpr const char* kEquidistant[] = {"k1", "k2", "k3", "k4"};
  static constexpr const char* kFov[] = {"w"};
  switch (model) {
    case CameraModel::kPinhole:
      return {};
    case CameraModel::kRadtan:
      return std::span(kRational).first<5>();
    case CameraModel::kEquidistant:
      return kEquidistant;
    case CameraModel::kRational:
      return kRational;
    case CameraModel::kFov:
      return kFov;
  }
  return {};
}

const char* Name(ReadoutStart start) {
  switch (start) {
    case ReadoutStart::kTop:
      return "top";
    case ReadoutStart::kBottom:
      return "bottom";
    case ReadoutStart::kLeft:
      return "left";
    case ReadoutStart::kRight:
      return "right";
  }
  return "unknown";
}

std::optional<ReadoutStart> FindReadoutStart(const std::string& name) {
  for (const ReadoutStart start :
       {ReadoutStart::kTop, ReadoutStart::kBottom, ReadoutStart::kLeft, ReadoutStart::kRight}) {
    if (name == Name(start)) return start;
  }
  return std::nullopt;
}

std::optional<Eigen::Vector2d> Camera::Project(const Eigen::Vector3d& point_in_cam,
                                               Eigen::Matrix<double, 2, 3>* J) const {
  // kPinhole is kRadtan with an empty polynomial.
  const auto normalised = model == CameraModel::kEquidistant
                              ? ProjectEquidistant(*this, point_in_cam, J)
                              : ProjectRadtan(*this, point_in_cam, J);
  if (!normalised) return std::nullopt;
  return Eigen::Vector2d(fx * normalised->x() + cx, fy * normalised->y() + cy);
}

std::optional<Eigen::Vector3d> Camera::Unproject(const Eigen::Vector2d& pixel) const {
  const Eigen::Vector2d distorted((pixel.x() - cx) / fx, (pixel.y() - cy) / fy);
  if (!distorted.allFinite()) return std::nullopt;
  if (model == CameraModel::kEquidistant) {
    const double radius = distorted.norm();
    if (radius == 0.0) return Eigen::Vector3d::UnitZ();
    const auto theta = UndistortAngle(OddPolynomial(*this), radius);
    if (!theta) return std::nullopt;
    const Eigen::Vector2d xy = distorted * (std::sin(*theta) / radius);
    return Eigen::Vector3d(xy.x(), xy.y(), std::cos(*theta)).normalized();
  }
  if (model == CameraModel::kPinhole) return distorted.homogeneous().normalized();
  const auto plane = UndistortRadtan(*this, distorted);
  if (!plane) return std::nullopt;
  return plane->homogeneous().normalized();
}

double Camera::ExposureTime(const Eigen::Vector2d& pixel) const {
  const bool along_rows =
      readout_from == ReadoutStart::kLeft || readout_from == ReadoutStart::kRight;
  const int length = along_rows ? width : height;
  if (length == 0) return 0.0;
  const double from_middle = ((along_rows ? pixel.x() : pixel.y()) + 0.5) / length - 0.5;
  const bool is_reversed =
      readout_from == ReadoutStart::kBottom || readout_from == ReadoutStart::kRight;
  return readout_s * (is_reversed ? -from_middle : from_middle);
}

std::optional<std::string> Camera::Problem() const {
  const auto positive = [](const char* name, double value) -> std::optional<std::string> {
    if (std::isfinite(value) && value > 0.0) return std::nullopt;
    std::ostringstream text;
    text << name << " is " << value << ", must be a positive number of pixels";
    return text.str();
  };
  if (auto problem = positive("fx", fx)) return problem;
  if (auto problem = positive("fy", fy)) return problem;
  if (!std::isfinite(cx)) return "cx is not a finite number";
  if (!std::isfinite(cy)) return "cy is not a finite number";
  for (std::size_t k = 0; k < distortion.size(); ++k) {
    if (!std::isfinite(distortion[k])) {
      return "distortion[" + std::to_string(k) + "] is not a finite number";
    }
  }
  if (!(readout_s >= 0.0 && readout_s < 1.0)) {
    std::ostringstream text;
    text << "readout_s is " << readout_s << ", must be 0 or more and below 1 second";
    return text.str();
  }
  if (width < 0 || height < 0 || (width == 0) != (height == 0)) {
    return "size is " + std::to_string(width) + "x" + std::to_string(height) +
           ", must be positive, or 0x0 for not known";
  }
  for (std::size_t k = DistortionNames(model).size(); k < distortion.size(); ++k) {
    if (distortion[k] == 0.0) continue;
    return "model " + std::string(Name(model)) + " has " +
           std::to_string(DistortionNames(model).size()) + " distortion coefficients, but number " +
           std::to_string(k + 1) + " is not zero";
  }
  return std::nullopt;
}

std::string Describe(const Camera& camera) {
  std::ostringstream text;
  text.precision(10);
  text << Name(camera.model) << ", fx " << camera.fx << ", fy " << camera.fy << ", cx " << camera.cx
       << ", cy " << camera.cy;
  const auto names = DistortionNames(camera.model);
  for (std::size_t k = 0; k < names.size(); ++k) {
    text << ", " << names[k] << " " << camera.distortion[k];
  }
  if (names.empty()) text << ", no distortion";
  if (camera.width > 0) {
    text << ", " << camera.width << "x" << camera.height;
  } else {
    text << ", size from the images";
  }
  if (camera.readout_s > 0.0) {
    text << ", rolling shutter " << camera.readout_s << " s";
    if (camera.readout_from != ReadoutStart::kTop)
      text << " from the " << Name(camera.readout_from);
  }
  return text.str();
}

}  // namespace rotslam
