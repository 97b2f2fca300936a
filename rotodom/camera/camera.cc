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
// tan of the largest angle off the axis that Unproject answers for models of the plane z = 1:
// 89.994 deg.
constexpr double kMaxRadius = 1e4;
// A kFov lens with a smaller field of view is a pinhole, to the last bit.
constexpr double kLeastFov = 1e-10;

// Whether a polynomial with these Bernstein coefficients on an interval is positive on all of it:
// it is where they are, else both halves are asked.
template <std::size_t n>
bool IsPositive(const std::array<double, n>& b, int depth = 0) {
  if (!(b.front() > 0.0 && b.back() > 0.0)) return false;
  bool all = true;
  for (std::size_t k = 1; k + 1 < n; ++k) all = all && b[k] > 0.0;
  if (all) return true;
  if (depth == 30) return false;  // touches zero within rounding
  std::array<double, n> left;
  std::array<double, n> right = b;
  for (std::size_t level = 0; level < n; ++level) {  // de Casteljau at one half
    left[level] = right[0];
    for (std::size_t k = 0; k + level + 1 < n; ++k) right[k] = 0.5 * (right[k] + right[k + 1]);
  }
  return IsPositive(left, depth + 1) && IsPositive(right, depth + 1);
}

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
  // s = t^2.
  bool IncreasesUpTo(double t) const {
    if (a_ == std::array<double, 4>{}) return true;
    const double s = t * t;
    const double c1 = 3.0 * a_[0] * s;
    const double c2 = 5.0 * a_[1] * s * s;
    const double c3 = 7.0 * a_[2] * s * s * s;
    const double c4 = 9.0 * a_[3] * s * s * s * s;
    // Far from the fold its terms cannot come to -1 together.
    if (std::abs(c1) + std::abs(c2) + std::abs(c3) + std::abs(c4) < 0.5) return true;
    return IsPositive(std::array{1.0,
                                 1.0 + c1 / 4.0,
                                 1.0 + c1 / 2.0 + c2 / 6.0,
                                 1.0 + 3.0 * c1 / 4.0 + c2 / 2.0 + c3 / 4.0,
                                 1.0 + c1 + c2 + c3 + c4});
  }

 private:
  std::array<double, 4> a_ = {};
};

// d(r) = r N(s) / D(s) with s = r^2, N = 1 + k1 s + k2 s^2 + k3 s^3 and D = 1 + k4 s + k5 s^2 +
// k6 s^3.
class RationalRadial {
 public:
  explicit RationalRadial(const Camera& camera) {
    const auto& k = camera.distortion;
    numerator_ = {1.0, k[0], k[1], k[4]};
    denominator_ = {1.0, k[5], k[6], k[7]};
  }

  // d(r) / r as a function of s = r^2, and its derivative by s.
  double Factor(double s) const { return Value(numerator_, s) / Value(denominator_, s); }
  double FactorSlope(double s) const {
    const double d = Value(denominator_, s);
    return (Slope(numerator_, s) * d - Value(numerator_, s) * Slope(denominator_, s)) / (d * d);
  }
  double Value(double r) const { return r * Factor(r * r); }

  // Whether D > 0 and d' > 0 on all of [0, r]: nothing up to r lies beyond the fold or a pole. Then
  // N > 0, too, since d' is not positive where N first comes down to zero.
  bool IncreasesUpTo(double r) const {
    // d' = Q / D^2 with Q = N D + 2 s (N' D - N D').
    std::array<double, 7> Q = {};
    for (std::size_t i = 0; i < 4; ++i) {
      for (std::size_t j = 0; j < 4; ++j) {
        const double share = 1.0 + 2.0 * (static_cast<double>(i) - static_cast<double>(j));
        Q[i + j] += share * numerator_[i] * denominator_[j];
      }
    }
    return IsPositiveUpTo(denominator_, r * r) && IsPositiveUpTo(Q, r * r);
  }

 private:
  using Cubic = std::array<double, 4>;

  static double Value(const Cubic& p, double s) {
    return p[0] + s * (p[1] + s * (p[2] + s * p[3]));
  }
  static double Slope(const Cubic& p, double s) { return p[1] + s * (2.0 * p[2] + s * 3.0 * p[3]); }

  // A polynomial whose coefficients start with 1, on [0, s].
  template <std::size_t n>
  static bool IsPositiveUpTo(std::array<double, n> p, double s) {
    double power = 1.0;
    double least = 1.0;
    for (std::size_t m = 1; m < n; ++m) {
      power *= s;
      p[m] *= power;
      if (!(p[m] >= 0.0)) least += p[m];
    }
    if (least > 0.0) return true;  // even with the negative terms at their end, all others at zero
    // Bernstein coefficient j is the sum of p[m] binomial(j, m) / binomial(n - 1, m) over m <= j.
    std::array<double, n> b;
    for (std::size_t j = 0; j < n; ++j) {
      double share = 1.0;
      b[j] = p[0];
      for (std::size_t m = 1; m <= j; ++m) {
        share *= static_cast<double>(j - m + 1) / static_cast<double>(n - m);
        b[j] += share * p[m];
      }
    }
    return IsPositive(b);
  }

  Cubic numerator_;
  Cubic denominator_;
};

// d(r) = atan(a r) / w with a = 2 tan(w / 2): even in w, and r where w is zero.
class FovRadial {
 public:
  explicit FovRadial(const Camera& camera)
      : w_(std::abs(camera.distortion[0])), a_(2.0 * std::tan(0.5 * w_)) {}

  // d(r) / r as a function of s = r^2, and its derivative by s.
  double Factor(double s) const {
    if (w_ < kLeastFov) return 1.0;
    if (s < kLeastSquare) return a_ / w_;
    const double r = std::sqrt(s);
    return std::atan(a_ * r) / (w_ * r);
  }
  double FactorSlope(double s) const {
    if (w_ < kLeastFov) return 0.0;
    if (s < kLeastSquare) return -a_ * a_ * a_ / (3.0 * w_);
    return (a_ / (w_ * (1.0 + a_ * a_ * s)) - Factor(s)) / (2.0 * s);
  }
  bool IncreasesUpTo(double r) const { return std::isfinite(r); }

  // The r with d(r) == value; nullopt beyond kMaxRadius.
  std::optional<double> Inverse(double value) const {
    const double angle = w_ * value;
    if (!(angle < 0.5 * std::numbers::pi)) return std::nullopt;
    const double r = w_ < kLeastFov ? value : std::tan(angle) / a_;
    if (!(r <= kMaxRadius)) return std::nullopt;
    return r;
  }

 private:
  static constexpr double kLeastSquare = 1e-24;

  double w_;
  double a_;
};

// The t in [0, max] with d(t) == value on the branch that starts at zero, or, when the fold or
// `max` comes first, the place where the branch ends. Bisection to the last bit.
template <class Radial>
double SolveOnFirstBranch(const Radial& radial, double value, double max) {
  double low = 0.0;
  double high = max;
  for (int k = 0; k < 100; ++k) {
    const double middle = 0.5 * (low + high);
    (radial.IncreasesUpTo(middle) && radial.Value(middle) < value ? low : high) = middle;
  }
  return low;
}

// Radial and tangential distortion of a point of the plane z = 1.
template <class Radial>
Eigen::Vector2d DistortOnPlane(const Camera& camera,
                               const Radial& radial,
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

// Solves DistortOnPlane(p) == target from `start`; every step is halved until it helps.
template <class Radial>
std::optional<Eigen::Vector2d> NewtonOnPlane(const Camera& camera,
                                             const Radial& radial,
                                             const Eigen::Vector2d& target,
                                             Eigen::Vector2d point) {
  const double unit = 1.0 + target.norm();
  Eigen::Matrix2d J;
  Eigen::Vector2d residual = target - DistortOnPlane(camera, radial, point, J);
  for (int k = 0; k < kMaxNewtonSteps && residual.norm() > kResidualGoal * unit; ++k) {
    const double det = J.determinant();
    if (!(det > 0.0)) return std::nullopt;
    Eigen::Vector2d step = J.inverse() * residual;
    bool better = false;
    for (int halving = 0; halving < 12 && !better; ++halving, step *= 0.5) {
      Eigen::Matrix2d J_next;
      const Eigen::Vector2d next = point + step;
      const Eigen::Vector2d r_next = target - DistortOnPlane(camera, radial, next, J_next);
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

template <class Radial>
std::optional<Eigen::Vector2d> UndistortOnPlane(const Camera& camera,
                                                const Radial& radial,
                                                const Eigen::Vector2d& distorted) {
  if (auto point = NewtonOnPlane(camera, radial, distorted, distorted)) return point;
  // Near the fold, or across a second branch: start from the radial part alone, solved exactly.
  const double radius = distorted.norm();
  const double start = SolveOnFirstBranch(radial, radius, kMaxRadius);
  return NewtonOnPlane(camera, radial, distorted, distorted * (start / radius));
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
  return solve_from(SolveOnFirstBranch(polynomial, distorted, std::numbers::pi));
}

template <class Radial>
std::optional<Eigen::Vector2d> ProjectOnPlane(const Camera& camera,
                                              const Eigen::Vector3d& point_in_cam,
                                              Eigen::Matrix<double, 2, 3>* J) {
  if (!(point_in_cam.z() > 0.0)) return std::nullopt;
  const Radial radial(camera);
  const double inverse_depth = 1.0 / point_in_cam.z();
  const Eigen::Vector2d plane = point_in_cam.head<2>() * inverse_depth;
  if (!radial.IncreasesUpTo(plane.norm())) return std::nullopt;
  Eigen::Matrix2d J_distort;
  const Eigen::Vector2d distorted = DistortOnPlane(camera, radial, plane, J_distort);
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

// Before focal lengths and principal point; J is of the pixel.
std::optional<Eigen::Vector2d> ProjectNormalised(const Camera& camera,
                                                 const Eigen::Vector3d& point_in_cam,
                                                 Eigen::Matrix<double, 2, 3>* J) {
  switch (camera.model) {
    case CameraModel::kPinhole:  // kRadtan with an empty polynomial
    case CameraModel::kRadtan:
      return ProjectOnPlane<OddPolynomial>(camera, point_in_cam, J);
    case CameraModel::kEquidistant:
      return ProjectEquidistant(camera, point_in_cam, J);
    case CameraModel::kRational:
      return ProjectOnPlane<RationalRadial>(camera, point_in_cam, J);
    case CameraModel::kFov:
      return ProjectOnPlane<FovRadial>(camera, point_in_cam, J);
  }
  return std::nullopt;
}

// Where the ray of a distorted point meets the plane z = 1; not for kEquidistant.
std::optional<Eigen::Vector2d> UndistortToPlane(const Camera& camera,
                                                const Eigen::Vector2d& distorted) {
  switch (camera.model) {
    case CameraModel::kPinhole:
      return distorted;
    case CameraModel::kRadtan:
      return UndistortOnPlane(camera, OddPolynomial(camera), distorted);
    case CameraModel::kRational:
      return UndistortOnPlane(camera, RationalRadial(camera), distorted);
    case CameraModel::kFov: {
      const double radius = distorted.norm();
      if (radius == 0.0) return distorted;
      const auto r = FovRadial(camera).Inverse(radius);
      if (!r) return std::nullopt;
      return Eigen::Vector2d(distorted * (*r / radius));
    }
    case CameraModel::kEquidistant:
      break;
  }
  return std::nullopt;
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

std::string CameraModelNames() {
  std::string names;
  for (const CameraModel model : AllCameraModels()) {
    names.append(names.empty() ? "" : ", ").append(Name(model));
  }
  return names;
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
  const auto normalised = ProjectNormalised(*this, point_in_cam, J);
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
  const auto plane = UndistortToPlane(*this, distorted);
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
  if (model == CameraModel::kFov && !(std::abs(distortion[0]) < std::numbers::pi)) {
    std::ostringstream text;
    text << "w is " << distortion[0] << ", must be a field of view in radians, below pi";
    return text.str();
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
