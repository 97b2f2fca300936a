#pragma once

#include <functional>
#include <string>
#include <vector>

#include "rotodom/types/trajectory.h"

namespace rotslam {

enum class MotionKind { kTranslating, kRotating };

/// `translating` or `rotating`, as segments.csv spells it.
const char* Name(MotionKind kind);

/// Frames first_frame .. last_frame, both included.
struct PathSegment {
  int first_frame = 0;
  int last_frame = 0;
  MotionKind kind = MotionKind::kTranslating;
};

/// A camera's pose as an exact function of time, with frame rate and number of frames.
struct CameraPath {
  /// Pose at a time since the start; any time, also a little before 0 and after the end.
  std::function<StampedPose(double time_s)> at;
  double fps = 30.0;
  int num_frames = 0;                 // frame k is taken at time k / fps
  std::vector<PathSegment> segments;  // empty: the path is not made of segments
};

/// Options of a walk with a hand-held camera.
struct HandheldPathOptions {
  int num_frames = 150;
  double fps = 30.0;
  double speed_scale = 1.0;  // 1: about 0.4 m/s and 25 deg/s
  std::uint64_t seed = 1;    // turns the phases of the sway
};

/// A walk with a hand-held camera in the free middle of MakeRoom: position and orientation are sums
/// of sinusoids, smooth to any order.
CameraPath HandheldPath(const HandheldPathOptions& options);

/// Axis of a camera's rotation: its vertical, horizontal or optical axis.
enum class TurnAxis { kYaw, kPitch, kRoll };

/// `yaw`, `pitch` or `roll`.
const char* Name(TurnAxis axis);

/// Options of a walk, a pure rotation and another walk.
struct GimbalPathOptions {
  int num_frames = 120;
  double fps = 30.0;
  TurnAxis axis = TurnAxis::kYaw;
  double turn_deg = 120.0;   // between the views of the two translating segments
  double lever_arm_m = 0.0;  // from the axis of the turn forward to the camera's centre
};

/// Translates, stops, rotates in place, and translates on, in the middle of MakeRoom, for 30 %, 40
/// % and 30 % of the frames. Twice continuously differentiable. With lever_arm_m 0 the centre is
/// exactly constant throughout the rotating segment.
CameraPath GimbalPath(const GimbalPathOptions& options);

/// Options of a drive along a street.
struct StreetPathOptions {
  double fps = 10.0;
  double speed_scale = 1.0;  // 1: 7 m/s
};

/// Fifty metres of street, a right turn of 90 deg on an arc that bends gently in and out, forty
/// metres more; the camera starts at the origin and looks forward, with a slight sway.
CameraPath StreetPath(const StreetPathOptions& options);

/// A path through given poses, pose k being reached at time k / fps (speed_scale 1): exactly there,
/// and between them by cubic (Catmull-Rom) centres and spherical linear orientations.
/// @param poses  at least two; their timestamps are not used.
CameraPath PathThroughPoses(Trajectory poses, double fps, double speed_scale);

/// Reads a KITTI pose file: twelve numbers a line, the rows of [R | t], camera->world. The
/// rotations are made orthonormal; timestamps are zero. Throws std::runtime_error that names file
/// and line.
Trajectory ReadKittiPoses(const std::string& path);

}  // namespace rotslam
