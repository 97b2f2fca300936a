#include "ba/cost/reprojection_cost.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Geometry>

#include "ba/cost/loss.h"
#include "rotodom/camera/lens_parameters.h"

namespace rotslam {
namespace {

constexpr int kPoseSize = 6;
constexpr double kOrigin[3] = {0.0, 0.0, 0.0};

template <int Cols>
using RowMatrix = Eigen::Matrix<double, 2, Cols, Eigen::RowMajor>;

// `Cols` columns of a Jacobian block that is `stride` wide.
template <int Cols>
Eigen::Map<RowMatrix<Cols>, 0, Eigen::OuterStride<>> ColumnsOf(double* data, int stride) {
  return Eigen::Map<RowMatrix<Cols>, 0, Eigen::OuterStride<>>(data, Eigen::OuterStride<>(stride));
}

// Where an observation's numbers lie, and where its derivatives go; null where it has none.
struct Blocks {
  const double* center = kOrigin;
  const double* point;
  double* J_turn = nullptr;
  double* J_center = nullptr;
  double* J_point = nullptr;
  std::array<double*, 2> J_lens = {};
  int camera_stride = 3;

  bool WantJacobians() const {
    return J_turn != nullptr || J_center != nullptr || J_point != nullptr || J_lens[0] != nullptr ||
           J_lens[1] != nullptr;
  }
};

Blocks BlocksOf(const ObservationForm& form, double const* const* parameters, double** jacobians) {
  int next = 0;
  const auto jacobian = [&] { return jacobians == nullptr ? nullptr : jacobians[next]; };
  Blocks blocks;
  if (form.camera == CameraLayout::kPose) {
    blocks.camera_stride = kPoseSize;
    blocks.J_turn = jacobian();
    if (blocks.J_turn != nullptr) blocks.J_center = blocks.J_turn + 3;
    if (!form.at_infinity) blocks.center = parameters[next] + 3;
    ++next;
  } else {
    if (form.camera == CameraLayout::kApart) {
      blocks.J_turn = jacobian();
      ++next;
    }
    if (!form.at_infinity) {
      blocks.J_center = jacobian();
      blocks.center = parameters[next];
      ++next;
    }
  }
  blocks.J_point = jacobian();
  blocks.point = parameters[next];
  for (int k = 0; k < form.num_lens_blocks; ++k) {
    ++next;
    blocks.J_lens[k] = jacobian();
  }
  return blocks;
}

}  // namespace

std::optional<Eigen::Vector2d> Reproject(const Camera& camera,
                                         const Eigen::Matrix3d& R_c_w,
                                         const Eigen::Vector3d& center_in_world,
                                         const Eigen::Vector3d& point_in_world,
                                         ReprojectionJacobian* J) {
  const Eigen::Vector3d point_in_cam = R_c_w * (point_in_world - center_in_world);
  if (J == nullptr) return camera.Project(point_in_cam);
  Eigen::Matrix<double, 2, 3> J_project;
  std::optional<Eigen::Vector2d> pixel = camera.Project(point_in_cam, &J_project);
  if (!pixel) return std::nullopt;
  // Exp(delta) p = p + delta x p, to first order.
  J->by_rotation.noalias() = -J_project * Skew(point_in_cam);
  J->by_point.noalias() = J_project * R_c_w;
  J->by_center = -J->by_point;
  return pixel;
}

Eigen::Matrix3d LeftJacobian(const Eigen::Vector3d& rotation_vector) {
  constexpr double kSmall = 1e-4;
  const double angle = rotation_vector.norm();
  const double square = angle * angle;
  double first = 0.5 - square / 24.0;
  double second = 1.0 / 6.0 - square / 120.0;
  if (angle > kSmall) {
    const double half = std::sin(0.5 * angle);
    first = 2.0 * half * half / square;
    second = (angle - std::sin(angle)) / (square * angle);
  }
  const Eigen::Matrix3d W = Skew(rotation_vector);
  return Eigen::Matrix3d::Identity() + first * W + second * W * W;
}

void TurnedRotation::Turn(const Eigen::Vector3d& turn) {
  R_c_w_ = At(turn).Matrix();
  J_turn_ = LeftJacobian(turn);
}

ReprojectionCost::ReprojectionCost(const ReprojectionState& state,
                                   const Eigen::Vector2d& keypoint_px,
                                   const Eigen::Matrix2d& scale,
                                   double huber_bend,
                                   const ObservationForm& form)
    : state_(state),
      keypoint_px_(keypoint_px),
      scale_(scale),
      huber_bend_(huber_bend),
      form_(form) {
  set_num_residuals(2);
  std::vector<std::int32_t>& sizes = *mutable_parameter_block_sizes();
  sizes.reserve(5);
  if (form.camera == CameraLayout::kPose) {
    sizes.push_back(kPoseSize);
  } else {
    if (form.camera == CameraLayout::kApart) sizes.push_back(3);
    if (!form.at_infinity) sizes.push_back(3);
  }
  sizes.push_back(3);
  for (int k = 0; k < form.num_lens_blocks; ++k) sizes.push_back(kLensBlockSize);
}

bool ReprojectionCost::Evaluate(double const* const* parameters,
                                double* residuals,
                                double** jacobians) const {
  const Blocks blocks = BlocksOf(form_, parameters, jacobians);
  const Eigen::Map<const Eigen::Vector3d> center(blocks.center);
  const Eigen::Vector3d point = Eigen::Vector3d::Map(blocks.point) + state_.shift.shift;
  ReprojectionJacobian J;
  std::optional<Eigen::Vector2d> pixel;
  if (!state_.shift.lost) {
    pixel = Reproject(state_.camera,
                      state_.rotation.Matrix(),
                      center,
                      point,
                      blocks.WantJacobians() ? &J : nullptr);
  }
  if (!pixel) {
    J.by_rotation.setZero();
    J.by_center.setZero();
    J.by_point.setZero();
  }
  const RobustResidual robust = UnderHuberLoss(
      pixel ? Eigen::Vector2d(scale_ * (*pixel - keypoint_px_))
            : Eigen::Vector2d(scale_ * Eigen::Vector2d::Constant(kUnseenResidual_px)),
      huber_bend_);
  Eigen::Vector2d::Map(residuals) = robust.value;
  const Eigen::Matrix2d weight = robust.weight * scale_;
  if (blocks.J_turn != nullptr) {
    const Eigen::Matrix<double, 2, 3> J_turn = J.by_rotation * state_.rotation.Jacobian();
    ColumnsOf<3>(blocks.J_turn, blocks.camera_stride).noalias() = weight * J_turn;
  }
  if (blocks.J_center != nullptr) {
    if (form_.at_infinity) J.by_center.setZero();
    ColumnsOf<3>(blocks.J_center, blocks.camera_stride).noalias() = weight * J.by_center;
  }
  if (blocks.J_point != nullptr) ColumnsOf<3>(blocks.J_point, 3).noalias() = weight * J.by_point;
  if (blocks.J_lens[0] != nullptr || blocks.J_lens[1] != nullptr) {
    Eigen::Matrix<double, 2, kLensSize> J_lens = Eigen::Matrix<double, 2, kLensSize>::Zero();
    if (pixel) {
      J_lens.noalias() = weight * LensJacobian(state_.camera,
                                               state_.calibrated,
                                               state_.rotation.Matrix() * (point - center),
                                               *pixel);
    }
    for (int k = 0; k < form_.num_lens_blocks; ++k) {
      if (blocks.J_lens[k] == nullptr) continue;
      ColumnsOf<kLensBlockSize>(blocks.J_lens[k], kLensBlockSize) =
          J_lens.middleCols<kLensBlockSize>(k * kLensBlockSize);
    }
  }
  return true;
}

ScaleAnchorCost::ScaleAnchorCost(const Eigen::Vector3d& origin,
                                 const Eigen::Vector3d& start_center,
                                 double weight,
                                 CameraLayout layout)
    : origin_(origin),
      scaled_direction_((start_center - origin) / (start_center - origin).squaredNorm()),
      weight_(weight),
      offset_(layout == CameraLayout::kPose ? 3 : 0) {
  set_num_residuals(1);
  mutable_parameter_block_sizes()->push_back(offset_ + 3);
}

bool ScaleAnchorCost::Evaluate(double const* const* parameters,
                               double* residuals,
                               double** jacobians) const {
  const Eigen::Map<const Eigen::Vector3d> center(parameters[0] + offset_);
  residuals[0] = weight_ * (scaled_direction_.dot(center - origin_) - 1.0);
  if (jacobians != nullptr && jacobians[0] != nullptr) {
    std::fill_n(jacobians[0], offset_, 0.0);
    Eigen::Map<Eigen::Vector3d> J(jacobians[0] + offset_);
    J = weight_ * scaled_direction_;
  }
  return true;
}

}  // namespace rotslam
