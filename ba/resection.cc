#include "ba/resection.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <stdexcept>
#include <utility>

#include <Eigen/Dense>

#include "ba/cost/reprojection_cost.h"
#include "rotodom/types/median.h"
#include "rotodom/types/options.h"
#include "rotodom/types/track.h"

namespace rotslam {
namespace {

using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

// A step that gains less, in squared sigmas, moves the pose by less than 1e-3 of its standard
// deviation, and what is left after it is far less.
constexpr double kWorthlessGain = 1e-7;

// Points refute the start's rotation where together with it they cost more than all but one in a
// thousand would that are as good as its covariance says, and they themselves twice what they cost
// alone: covariances of real footage are up to eight times too small, and blur and a rolling
// shutter make points err together. Nor do points that fit it within their deviations: what little
// a few of them cost otherwise is their depths' doing, in a turn with hardly any parallax.
constexpr double kMostRotationCost = 8.1;
constexpr double kMostCostRatio = 2.0;

// Steps at each of the wider scales, which only lead to the last one, and how many observations
// they take.
constexpr int kCoarseIterations = 3;
constexpr std::size_t kCoarseObservations = 200;

struct Pose {
  Rotation cam_from_world;
  Eigen::Vector3d center_in_world;
};

// (I - ...) with Log(Exp(delta) Exp(phi)) = phi + LeftInverse(phi) delta, to first order.
Eigen::Matrix3d LeftInverse(const Eigen::Vector3d& phi) {
  const double angle = phi.norm();
  const Eigen::Matrix3d S = Skew(phi);
  const double c =
      angle < 1e-3 ? 1.0 / 12.0 : 1.0 / (angle * angle) - 0.5 / (angle * std::tan(0.5 * angle));
  return Eigen::Matrix3d::Identity() - 0.5 * S + c * S * S;
}

// Normal equations of one pass: information, its right-hand side, and the robust cost.
struct Normal {
  Matrix6d H = Matrix6d::Zero();
  Vector6d g = Vector6d::Zero();
  double cost = 0.0;
};

// Sums of the normal equations with the centre's derivatives in the camera's frame, where they are
// those of the projection.
class PoseSums {
 public:
  double cost = 0.0;

  // @param J  of the residual by the point in the camera's frame.
  void Add(const Eigen::Vector3d& in_cam,
           const Eigen::Matrix<double, 2, 3>& J,
           const Eigen::Vector2d& residual,
           double weight) {
    std::array<double, 6> x;
    std::array<double, 6> y;
    // Exp(delta) p = p + delta x p, to first order; the point moves against the centre.
    const auto fill = [&](int row, std::array<double, 6>& to) {
      const double a = J(row, 0);
      const double b = J(row, 1);
      const double c = J(row, 2);
      to = {in_cam.y() * c - in_cam.z() * b,
            in_cam.z() * a - in_cam.x() * c,
            in_cam.x() * b - in_cam.y() * a,
            -a,
            -b,
            -c};
    };
    fill(0, x);
    fill(1, y);
    int n = 0;
    for (int i = 0; i < 6; ++i) {
      const double wx = weight * x[i];
      const double wy = weight * y[i];
      for (int l = 0; l <= i; ++l) lower_[n++] += wx * x[l] + wy * y[l];
      g_[i] += wx * residual.x() + wy * residual.y();
    }
  }

  // @param share  how many observations each one stands for.
  Normal InWorld(const Eigen::Matrix3d& R_c_w, double share) const {
    Normal normal;
    int n = 0;
    for (int i = 0; i < 6; ++i) {
      for (int l = 0; l <= i; ++l) normal.H(i, l) = normal.H(l, i) = share * lower_[n++];
      normal.g[i] = share * g_[i];
    }
    normal.H.rightCols<3>() = (normal.H.rightCols<3>() * R_c_w).eval();
    normal.H.bottomRows<3>() = (R_c_w.transpose() * normal.H.bottomRows<3>()).eval();
    normal.g.tail<3>() = (R_c_w.transpose() * normal.g.tail<3>()).eval();
    normal.cost = share * cost;
    return normal;
  }

 private:
  std::array<double, 21> lower_ = {};
  std::array<double, 6> g_ = {};
};

class Resection {
 public:
  Resection(const Camera& camera,
            const std::vector<PointObservation2D3D>& observations,
            const ResectionStart& start,
            const ResectionOptions& options)
      : camera_(camera), observations_(observations), start_(start), options_(options) {
    scales_.reserve(observations.size());
    for (const PointObservation2D3D& observation : observations) {
      const double sharpness = 1.0 / observation.sigma_px;
      scales_.push_back(options.has_motion_blur
                            ? Eigen::Matrix2d(sharpness * Deblurring(observation.blur))
                            : Eigen::Matrix2d(sharpness * Eigen::Matrix2d::Identity()));
    }
    if (start.rotation_covariance) prior_information_ = start.rotation_covariance->inverse();
  }

  // Residual in sigmas; what does not project is far off.
  double Sigmas(const Pose& pose, std::size_t k) const {
    const PointObservation2D3D& observation = observations_[k];
    const auto pixel = Reproject(
        camera_, pose.cam_from_world.Matrix(), pose.center_in_world, observation.point_in_world);
    if (!pixel) return kUnseenResidual_px / observation.sigma_px;
    return (scales_[k] * (*pixel - observation.keypoint_px)).norm();
  }

  std::vector<double> AllSigmas(const Pose& pose) const {
    std::vector<double> sigmas;
    sigmas.reserve(observations_.size());
    for (std::size_t k = 0; k < observations_.size(); ++k) sigmas.push_back(Sigmas(pose, k));
    return sigmas;
  }

  // @param sigmas  residual of observation k.
  bool IsInlier(std::size_t k, double sigmas) const {
    const double sigma_px = observations_[k].sigma_px;
    return sigmas * sigma_px <= options_.max_error_px * std::max(1.0, sigma_px);
  }

  // `scale`: of Geman-McClure's loss s^2 / 2 r^2 / (r^2 + s^2); zero: inliers, plainly weighted.
  // `step`: of every so many observations one, which counts for all of them.
  Normal Evaluate(const Pose& pose, double scale, std::size_t step = 1) const {
    PoseSums sums;
    const Eigen::Matrix3d R_c_w = pose.cam_from_world.Matrix();
    for (std::size_t k = 0; k < observations_.size(); k += step) {
      const PointObservation2D3D& observation = observations_[k];
      const Eigen::Vector3d in_cam = R_c_w * (observation.point_in_world - pose.center_in_world);
      Eigen::Matrix<double, 2, 3> J;
      const auto pixel = camera_.Project(in_cam, &J);
      if (!pixel) {
        const double unseen = kUnseenResidual_px / observation.sigma_px;
        if (scale > 0.0) {
          const double squared = 2.0 * unseen * unseen;
          sums.cost += 0.5 * squared * scale * scale / (squared + scale * scale);
        } else if (IsInlier(k, unseen)) {
          sums.cost += unseen * unseen;
        }
        continue;
      }
      const Eigen::Vector2d residual = scales_[k] * (*pixel - observation.keypoint_px);
      const double squared = residual.squaredNorm();
      if (scale == 0.0 && !IsInlier(k, std::sqrt(squared))) continue;
      const double keep = scale == 0.0 ? 1.0 : scale * scale / (squared + scale * scale);
      sums.cost += 0.5 * squared * keep;
      const Eigen::Matrix<double, 2, 3> J_scaled = scales_[k] * J;
      sums.Add(in_cam, J_scaled, residual, keep * keep);
    }
    Normal normal = sums.InWorld(R_c_w, static_cast<double>(step));
    AddPrior(pose, normal);
    Hold(normal);
    return normal;
  }

  // Levenberg-Marquardt at one scale. Returns whether it settled.
  bool Minimise(double scale, int max_iterations, Pose& pose, std::size_t every = 1) const {
    double damping = 1e-6;
    Normal normal = Evaluate(pose, scale, every);
    for (int iteration = 0; iteration < max_iterations; ++iteration) {
      Matrix6d H = normal.H;
      H.diagonal() *= 1.0 + damping;
      const Vector6d step = -H.ldlt().solve(normal.g);
      if (!step.allFinite()) return false;
      // Cost this step may gain, in squared sigmas.
      const double expected = -0.5 * normal.g.dot(step);
      const Pose next = Moved(pose, step);
      // Most steps are taken, so the derivatives at the next pose are rarely in vain.
      const Normal next_normal = Evaluate(next, scale, every);
      if (next_normal.cost <= normal.cost) {
        pose = next;
        normal = next_normal;
        damping = std::max(1e-12, 0.1 * damping);
      } else {
        damping *= 10.0;
      }
      if (expected <= kWorthlessGain) return true;
    }
    return false;
  }

  // From a start that may be far off: losses are wide at first, so that it still feels the inliers.
  // Returns whether it settled.
  bool Settle(Pose& pose) const {
    double scale = std::max(options_.loss_scale, 2.0 * Median(AllSigmas(pose)));
    const std::size_t every = std::max<std::size_t>(1, observations_.size() / kCoarseObservations);
    for (; scale > options_.loss_scale; scale = std::max(options_.loss_scale, 0.5 * scale)) {
      Minimise(scale, kCoarseIterations, pose, every);
    }
    return Minimise(options_.loss_scale, options_.max_iterations, pose);
  }

  double Cost(const Pose& pose) const { return Evaluate(pose, options_.loss_scale).cost; }

  // What the start's rotation may cost at most at a pose where the cost is least: its own share
  // there, and more than what the points alone would still gain.
  double MostRotationCost(const Pose& pose) const {
    constexpr double kMore = 4.0;  // steps of a robust loss come short
    Resection by_points = *this;
    by_points.ForgetRotation();
    const Normal points = by_points.Evaluate(pose, options_.loss_scale);
    const double gain = 0.5 * points.g.dot(points.H.ldlt().solve(points.g));
    if (!std::isfinite(gain)) return std::numeric_limits<double>::infinity();
    return Cost(pose) - points.cost + kMore * std::abs(gain);
  }

  // From here on the start's rotation is no measurement any more.
  void ForgetRotation() { prior_information_.reset(); }

 private:
  // What is held keeps its last bit.
  Pose Moved(const Pose& pose, const Vector6d& step) const {
    Pose moved = pose;
    if (options_.refine_rotation) {
      moved.cam_from_world = Rotation::Exp(step.head<3>()) * pose.cam_from_world;
    }
    if (options_.refine_center) moved.center_in_world += step.tail<3>();
    return moved;
  }

  void AddPrior(const Pose& pose, Normal& normal) const {
    if (!prior_information_) return;
    const Eigen::Vector3d phi = (pose.cam_from_world * start_.cam_from_world.Inverse()).Log();
    const Eigen::Matrix3d J = LeftInverse(phi);
    normal.cost += 0.5 * phi.dot(*prior_information_ * phi);
    normal.H.topLeftCorner<3, 3>() += J.transpose() * *prior_information_ * J;
    normal.g.head<3>() += J.transpose() * *prior_information_ * phi;
  }

  // Decouples what does not move: zero gradient, identity information.
  void Hold(Normal& normal) const {
    const auto hold = [&](int first) {
      normal.H.middleRows<3>(first).setZero();
      normal.H.middleCols<3>(first).setZero();
      normal.H.block<3, 3>(first, first).setIdentity();
      normal.g.segment<3>(first).setZero();
    };
    if (!options_.refine_rotation) hold(0);
    if (!options_.refine_center) hold(3);
  }

  const Camera& camera_;
  const std::vector<PointObservation2D3D>& observations_;
  const ResectionStart& start_;
  const ResectionOptions& options_;
  std::vector<Eigen::Matrix2d> scales_;  // sigmas per pixel
  std::optional<Eigen::Matrix3d> prior_information_;
};

// Inverse of the information; nullopt when it leaves a direction open. Scaled to a unit diagonal
// first, since radians and world units do not compare.
std::optional<Matrix6d> Covariance(const Matrix6d& H) {
  if (!H.allFinite() || !(H.diagonal().minCoeff() > 0.0)) return std::nullopt;
  const Vector6d scale = H.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen(scale.asDiagonal() * H * scale.asDiagonal());
  if (eigen.info() != Eigen::Success || eigen.eigenvalues()[0] < 1e-12) return std::nullopt;
  const Matrix6d inverse = eigen.eigenvectors() * eigen.eigenvalues().cwiseInverse().asDiagonal() *
                           eigen.eigenvectors().transpose();
  return Matrix6d(scale.asDiagonal() * inverse * scale.asDiagonal());
}

// Throws as ResectFrame does.
void RefuseBadInputs(const Camera& camera,
                     const ResectionStart& start,
                     const ResectionOptions& options) {
  const auto refuse = [](const std::string& reason) {
    throw std::invalid_argument("ResectFrame: " + reason);
  };
  if (const auto problem = options.Problem()) refuse("option " + *problem);
  if (const auto problem = camera.Problem()) refuse("camera " + *problem);
  if (!start.center_in_world.allFinite()) refuse("the start centre is not finite");
  if (start.rotation_covariance && !(start.rotation_covariance->allFinite() &&
                                     start.rotation_covariance->llt().info() == Eigen::Success)) {
    refuse("the rotation covariance is not positive definite");
  }
}

std::vector<PointObservation2D3D> FiniteOnes(
    const std::vector<PointObservation2D3D>& observations) {
  std::vector<PointObservation2D3D> finite;
  for (const PointObservation2D3D& observation : observations) {
    if (observation.point_in_world.allFinite() && observation.keypoint_px.allFinite() &&
        std::isfinite(observation.sigma_px) && observation.sigma_px > 0.0) {
      finite.push_back(observation);
    }
  }
  return finite;
}

// What the observations tell about a pose; nullopt with too few inliers, or when they leave it
// open.
std::optional<ResectedPose> Describe(const Pose& pose,
                                     const Resection& resection,
                                     const std::vector<PointObservation2D3D>& finite,
                                     const ResectionOptions& options) {
  ResectedPose result;
  result.cam_from_world = pose.cam_from_world;
  result.center_in_world = pose.center_in_world;
  double squares = 0.0;
  double squares_in_sigmas = 0.0;
  const std::vector<double> sigmas = resection.AllSigmas(pose);
  for (std::size_t k = 0; k < sigmas.size(); ++k) {
    if (!resection.IsInlier(k, sigmas[k])) continue;
    ++result.num_inliers;
    squares_in_sigmas += sigmas[k] * sigmas[k];
    const double error_px = sigmas[k] * finite[k].sigma_px;
    squares += error_px * error_px;
  }
  if (result.num_inliers < options.min_inliers) return std::nullopt;
  result.rms_px = std::sqrt(squares / result.num_inliers);
  const int num_unknowns = (options.refine_rotation ? 3 : 0) + (options.refine_center ? 3 : 0);
  const int freedom = std::max(1, 2 * result.num_inliers - num_unknowns);
  result.variance_factor = squares_in_sigmas / freedom;
  const std::optional<Matrix6d> covariance = Covariance(resection.Evaluate(pose, 0.0).H);
  if (!covariance) return std::nullopt;
  result.covariance = *covariance;
  if (!options.refine_rotation) result.covariance.topLeftCorner<3, 3>().setZero();
  if (!options.refine_center) result.covariance.bottomRightCorner<3, 3>().setZero();
  return result;
}

}  // namespace

std::optional<std::string> ResectionOptions::Problem() const {
  if (!refine_rotation && !refine_center) {
    return OutOfRange("refine_center", "false", "true where refine_rotation is false");
  }
  if (!(loss_scale > 0.0)) return OutOfRange("loss_scale", loss_scale, "positive");
  if (!(max_error_px > 0.0)) return OutOfRange("max_error_px", max_error_px, "positive");
  if (min_inliers < 3) return OutOfRange("min_inliers", min_inliers, "at least 3");
  if (max_iterations < 1) return OutOfRange("max_iterations", max_iterations, "at least 1");
  return std::nullopt;
}

std::optional<ResectedPose> ResectFrame(const Camera& camera,
                                        const std::vector<PointObservation2D3D>& observations,
                                        const ResectionStart& start,
                                        const ResectionOptions& options) {
  RefuseBadInputs(camera, start, options);
  const std::vector<PointObservation2D3D> finite = FiniteOnes(observations);
  if (static_cast<int>(finite.size()) < options.min_inliers) return std::nullopt;

  Resection resection(camera, finite, start, options);
  Pose pose = {start.cam_from_world, start.center_in_world};
  if (!resection.Settle(pose)) return std::nullopt;
  if (start.rotation_covariance && options.refine_rotation &&
      resection.MostRotationCost(pose) > kMostRotationCost) {
    Resection by_points = resection;
    by_points.ForgetRotation();
    Pose other = pose;
    const bool settled = by_points.Settle(other);
    const double cost = by_points.Cost(other);
    const double by_deviations = static_cast<double>(finite.size());  // two coordinates each
    if (settled && resection.Cost(pose) > cost + kMostRotationCost &&
        by_points.Cost(pose) > std::max(kMostCostRatio * cost, by_deviations)) {
      pose = other;
      resection.ForgetRotation();
    }
  }

  return Describe(pose, resection, finite, options);
}

std::optional<ResectedPose> AssessPose(const Camera& camera,
                                       const std::vector<PointObservation2D3D>& observations,
                                       const ResectionStart& start,
                                       const ResectionOptions& options) {
  RefuseBadInputs(camera, start, options);
  const std::vector<PointObservation2D3D> finite = FiniteOnes(observations);
  Resection resection(camera, finite, start, options);
  resection.ForgetRotation();
  return Describe({start.cam_from_world, start.center_in_world}, resection, finite, options);
}

}  // namespace rotslam
