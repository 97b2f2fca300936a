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

/// A vector that was zero at time 0, at another time.
struct TimedOffset {
  double after_s = 0.0;
  Eigen::Vector3d offset;
};

/// The polynomial of lowest degree without constant part through `offsets`.
/// @param offsets  at most four, at different times, none of them 0; without any it is 0.
PowerCoefficients PolynomialThrough(std::span<const TimedOffset> offsets);

/// How a camera turns while the rows of a frame are exposed.
struct AngularMotion {
  // Of the rotation vector since mid-frame, rad in camera axes.
  PowerCoefficients coefficients = PowerCoefficients::Zero();

  /// The camera `seconds` after mid-frame, from the camera in mid-frame.
  Rotation After(double seconds) const;
  /// A vector in the camera `seconds` after mid-frame, in the camera in mid-frame: the inverse of
  /// After(), three times as fast for one vector.
  Eigen::Vector3d ToMidFrame(double seconds, const Eigen::Vector3d& vector) const;
};

/// An orientation and when it was taken.
struct TimedOrientation {
  double time_s = 0.0;
  Rotation cam_from_world;
};

/// The smoothest motion through the orientations of a frame and of others: rotation vectors from
/// the frame's are a polynomial of time.
/// @param others  at most four, at different times; none: no motion.
AngularMotion MotionThrough(const TimedOrientation& frame,
                            std::span<const TimedOrientation> others);

/// The same by the frames next to it, in turn behind and before; where one side has no more, by
/// those of the other.
/// @param time_s      of each frame; ascending.
/// @param num_others  at most four.
AngularMotion MotionAt(FrameId frame,
                       const RotationMap& cam_from_world,
                       const std::function<double(FrameId)>& time_s,
                       int num_others);

/// A motion, and how far it may be off while the rows of a frame are exposed, radians.
struct BelievedMotion {
  AngularMotion motion;
  double error_rad = 0.0;

  /// The same of most rows, which are nearer to the middle than the ones that are off by that.
  double TypicalErrorRad() const { return 0.5 * error_rad; }
};

/// MotionAt through two other frames; what a third would make of it tells the error. Going through
/// that one, too, measured worse where tracking is noisy (7-Scenes kitchen, RPE_1 0.231 instead of
/// 0.206 deg).
BelievedMotion BelievedMotionAt(FrameId frame,
                                const RotationMap& cam_from_world,
                                const std::function<double(FrameId)>& time_s,
                                double readout_s);

/// A bearing in the camera as it stood then, seconds after the middle of a frame.
struct TimedBearing {
  double after_s = 0.0;
  Eigen::Vector3d bearing;
};

/// What would have been seen of a point in the middle of a frame, in the camera as it stood then.
/// The motion is taken out of what was seen of it around; what is left, its parallax and what is
/// wrong with the motion, is a polynomial of time.
/// @param seen  at least one; at different times.
/// @return  unit.
/// Error:   with bearings from the frame and its two neighbours none to second order in time, even
///          where the motion is wrong.
Eigen::Vector3d BearingInMidFrame(const AngularMotion& motion, std::span<const TimedBearing> seen);

/// Sets the bearings of a view to what they would be had all its rows been exposed in the middle of
/// the frame; its keypoints stay where they are. Those without a bearing keep the one they have.
/// @param others  that may show the same points; of the same camera. What they saw within half a
///                readout of the view, or of each other, does not count.
void CorrectRollingShutter(const Camera& camera,
                           const AngularMotion& motion,
                           std::span<const View* const> others,
                           View& view);

/// Moves corners, keypoints and bearings, to where they would be had all rows been exposed in the
/// middle of the frame; those without a bearing stay.
void MoveToMidFrame(const Camera& camera, const AngularMotion& motion, Features& corners);

}  // namespace rotslam
