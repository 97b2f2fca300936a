#pragma once

#include <optional>

#include <Eigen/Core>
#include <ceres/cost_function.h>

#include "rotodom/camera/camera.h"
#include "rotodom/types/rotation.h"

namespace rotslam {

/// Derivatives of a pixel by pose and point.
struct ReprojectionJacobian {
  Eigen::Matrix<double, 2, 3> by_rotation;  // px per rad of delta, Exp(delta) * cam_from_world
  Eigen::Matrix<double, 2, 3> by_center;    // px per world unit
  Eigen::Matrix<double, 2, 3> by_point;     // px per world unit
};

/// Pixel at which a camera sees a point; nullopt where the camera model does not reach.
/// @param R_c_w  cam_from_world as a matrix.
/// @param J      when given, receives the derivatives.
/// Error: J equals central differences to 1e-6 of its size, for every camera model (ba tests).
std::optional<Eigen::Vector2d> Reproject(const Camera& camera,
                                         const Eigen::Matrix3d& R_c_w,
                                         const Eigen::Vector3d& center_in_world,
                                         const Eigen::Vector3d& point_in_world,
                                         ReprojectionJacobian* J = nullptr);

/// Residual of a point the model cannot project (behind the camera, beyond the fold), per axis and
/// in pixels, with zero derivative: a step that pushes some points behind a camera costs something
/// but is not refused for their sake, and the next classification places them anew or drops them.
/// More than rounds keep; at 1,000 px some hundred points of a long way outweighed all others.
inline constexpr double kUnseenResidual_px = 20.0;

/// A frame's orientation while a minimisation moves it: Exp(turn) * start, in exponential
/// coordinates about where it starts. What all observations of the frame have in common is worked
/// out once for all of them.
class TurnedRotation {
 public:
  explicit TurnedRotation(const Rotation& start) : start_(start) { Turn(Eigen::Vector3d::Zero()); }

  /// @param turn  radians, in the camera's frame; shorter than a full turn.
  void Turn(const Eigen::Vector3d& turn);
  /// Exp(turn) * start.
  Rotation At(const Eigen::Vector3d& turn) const { return Rotation::Exp(turn) * start_; }

  // As of the last turn.
  const Eigen::Matrix3d& Matrix() const { return R_c_w_; }
  // d(delta) / d(turn), where Exp(delta) * R_c_w is where a small change of the turn leads.
  const Eigen::Matrix3d& Jacobian() const { return J_turn_; }

 private:
  Rotation start_;
  Eigen::Matrix3d R_c_w_;
  Eigen::Matrix3d J_turn_;
};

/// d(delta) / d(v) for a rotation vector v: Exp(v + change) = Exp(delta) * Exp(v).
/// Error: equals central differences to 1e-8 (ba tests).
Eigen::Matrix3d LeftJacobian(const Eigen::Vector3d& rotation_vector);

/// The parameter blocks of a camera.
enum class CameraLayout {
  kPose,    // turn and centre, one block of six: Ceres' specialised elimination
  kApart,   // turn (3), then centre (3), which frames can share
  kCenter,  // centre (3); the rotation is held
};

/// The parameter blocks of an observation: those of the camera, the point (3), the lens (6
/// each).
struct ObservationForm {
  CameraLayout camera = CameraLayout::kPose;
  // The point lies in a direction of any length, without depth: the centre does not count, and has
  // no block where it comes apart. Such tracks are seen from one place only, but tell how the
  // camera turned. Not with kCenter, where they have nothing to say.
  bool at_infinity = false;
  // Blocks of LensParameters come last: none, the first, or both.
  int num_lens_blocks = 0;
};

/// A shift that a caller adds to a point between evaluations.
struct PointShift {
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();
  bool lost = false;  // not to be seen from anywhere
};

/// State that a caller updates with the parameters (see ceres::EvaluationCallback). It must outlive
/// the cost function.
struct ReprojectionState {
  const Camera& camera;            // with the lens that the parameters say
  const Camera& calibrated;        // what LensParameters refer to
  const TurnedRotation& rotation;  // turned as the parameters say
  const PointShift& shift;         // of the point
};

/// scale (Project(R_c_w (point + shift - center)) - keypoint_px), under Huber's loss: see
/// UnderHuberLoss. Its derivatives are what steps are taken with, exact up to the loss' bend.
class ReprojectionCost final : public ceres::CostFunction {
 public:
  /// @param scale       sigmas per pixel: the inverse root of the keypoint's covariance.
  /// @param huber_bend  of Huber's loss, in sigmas; 0: no loss.
  ReprojectionCost(const ReprojectionState& state,
                   const Eigen::Vector2d& keypoint_px,
                   const Eigen::Matrix2d& scale,
                   double huber_bend = 0.0,
                   const ObservationForm& form = {});
  bool Evaluate(double const* const* parameters,
                double* residuals,
                double** jacobians) const override;

 private:
  ReprojectionState state_;
  Eigen::Vector2d keypoint_px_;
  Eigen::Matrix2d scale_;
  double huber_bend_;
  ObservationForm form_;
};

/// weight * (direction . (center - origin) / length - 1): keeps one coordinate of one centre, and
/// with it the scale of everything. Scale is free otherwise, so the residual is zero at the optimum
/// and moves nothing there; unlike a smaller parameter block it leaves all camera blocks the same
/// size, which is what Ceres' specialised Schur elimination asks for.
class ScaleAnchorCost final : public ceres::CostFunction {
 public:
  /// @param layout  of the camera whose block has the centre in it.
  ScaleAnchorCost(const Eigen::Vector3d& origin,
                  const Eigen::Vector3d& start_center,
                  double weight,
                  CameraLayout layout);
  bool Evaluate(double const* const* parameters,
                double* residuals,
                double** jacobians) const override;

 private:
  Eigen::Vector3d origin_;
  Eigen::Vector3d scaled_direction_;  // direction / length
  double weight_;
  int offset_;  // of the centre in its block
};

}  // namespace rotslam
