#pragma once

#include <functional>
#include <span>

#include <Eigen/Core>

#include "rotodom/camera/camera.h"
#include "rotodom/features/features.h"
#include "rotodom/features/view.h"
#include "rotodom/types/maps.h"

namespace rotslam {

/// Column k belongs to the (k+1)th power of a time in seconds.
using PowerCoefficients = Eigen::Matrix<double, 3, 4>;

/// A value at some time of a vector that is zero at time 0.
struct TimedOffset {
  double after_s = 0.0;
  Eigen::Vector3d offset;
};

/// The polynomial of lowest degree without constant term through `offsets`.
/// @param offsets  at most four, at different times other than 0; the result is 0 for none.
PowerCoefficients PolynomialThrough(std::span<const TimedOffset> offsets);

/// Rotation of a camera during the readout of a frame.
struct AngularMotion {
  // Rotation vector since mid-frame as a polynomial of time, rad in camera axes.
  PowerCoefficients coefficients = PowerCoefficients::Zero();

  /// Rotation from the camera at mid-frame to that `seconds` later.
  Rotation After(double seconds) const;
  /// Transforms a vector from the camera `seconds` after mid-frame to that at mid-frame: the
  /// inverse of After(), three times as fast for one vector.
  Eigen::Vector3d ToMidFrame(double seconds, const Eigen::Vector3d& vector) const;
};

/// An orientation at a time.
struct TimedOrientation {
  double time_s = 0.0;
  Rotation cam_from_world;
};

/// Motion through the orientations of a frame and of others: the rotation vector relative to the
/// frame is the polynomial of time of lowest degree.
/// @param others  at most four, at different times; none: no motion.
AngularMotion MotionThrough(const TimedOrientation& frame,
                            std::span<const TimedOrientation> others);

/// The same with the nearest other frames, alternating between before and after; where one side has
/// no more, with those of the other side.
/// @param time_s      of each frame; ascending.
/// @param num_others  at most four.
AngularMotion MotionAt(FrameId frame,
                       const RotationMap& cam_from_world,
                       const std::function<double(FrameId)>& time_s,
                       int num_others);

/// A motion and its error during the readout of a frame, rad.
struct MotionEstimate {
  AngularMotion motion;
  double error_rad = 0.0;

  /// Error of most rows, which are nearer to mid-frame than the rows with `error_rad`.
  double TypicalErrorRad() const { return 0.5 * error_rad; }
};

/// MotionAt with two other frames. The error is the difference from the motion with a third one;
/// using three for the motion itself is less accurate where tracking is noisy.
MotionEstimate EstimateMotionAt(FrameId frame,
                                const RotationMap& cam_from_world,
                                const std::function<double(FrameId)>& time_s,
                                double readout_s);

/// A bearing in the camera frame at that time, in seconds after mid-frame.
struct TimedBearing {
  double after_s = 0.0;
  Eigen::Vector3d bearing;
};

/// Bearing of a point at mid-frame, in the camera at mid-frame. The known rotation is removed from
/// the observations; the remainder, parallax and errors of the rotation, is a polynomial of time.
/// @param seen  observations at different times, at least one.
/// @return  unit.
/// Error:   none to second order in time with bearings from the frame and its two neighbours, even
///          where the rotation is wrong.
Eigen::Vector3d BearingInMidFrame(const AngularMotion& motion, std::span<const TimedBearing> seen);

/// Sets the bearings of a view to those of a global-shutter image taken at mid-frame. Its keypoints
/// are not changed, and keypoints without a bearing in the model keep the one they have.
/// @param others  views of the same camera that may see the same points. Observations within half a
///                readout of the view, or of each other, are ignored.
void CorrectRollingShutter(const Camera& camera,
                           const AngularMotion& motion,
                           std::span<const View* const> others,
                           int num_threads,
                           View& view);

/// Moves corners (keypoints and bearings) to their positions in a global-shutter image taken at
/// mid-frame; those without a bearing are not moved.
void MoveToMidFrame(const Camera& camera, const AngularMotion& motion, Features& corners);

}  // namespace rotslam
