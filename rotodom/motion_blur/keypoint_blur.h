#pragma once

#include <functional>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "rotodom/camera/camera.h"
#include "rotodom/rolling_shutter/rolling_shutter.h"
#include "rotodom/types/maps.h"
#include "rotodom/types/track.h"

namespace rotslam {

/// Angular velocity by frame, rad/s in camera axes.
using RotationRates = std::map<FrameId, Eigen::Vector3d>;

/// Longest time between frames of a video, s. The motion during the exposure of still pictures is
/// not known.
inline constexpr double kFarthestFrame_s = 0.15;

/// Angular velocity at a frame from its orientation and the two orientations of others that are
/// nearest in time.
/// @param others      at different times; one at the frame's own time is ignored.
/// @param farthest_s  others beyond this time are ignored, s.
/// @return  nullopt where none is left.
std::optional<Eigen::Vector3d> RateThrough(const TimedOrientation& frame,
                                           std::span<const TimedOrientation> others,
                                           double farthest_s = kFarthestFrame_s);

/// The same with the neighbouring frames.
/// @param time_s  of each frame; ascending.
std::optional<Eigen::Vector3d> RateOf(FrameId frame,
                                      const RotationMap& cam_from_world,
                                      const std::function<double(FrameId)>& time_s,
                                      double farthest_s = kFarthestFrame_s);

/// Angular velocities of all frames that have one.
RotationRates RatesOf(const RotationMap& cam_from_world,
                      const std::function<double(FrameId)>& time_s);

/// Blur vector of a keypoint caused by a rotation during the exposure, as in Observation::blur,
/// without a limit of its length.
/// @param rate           rad/s, in camera axes.
/// @param blur_s_per_px  length of the blur vector per image speed in px/s.
/// @return  zero where the camera does not see the bearing.
Eigen::Vector2d BlurVectorOf(const Camera& camera,
                             const Eigen::Vector3d& bearing,
                             const Eigen::Vector3d& rate,
                             double blur_s_per_px);

/// Sets the blur vector of each observation (Observation::blur) from the rotation of its frame;
/// zero for frames without an angular velocity.
/// @param blur_s_per_px  length of the blur vector per image speed in px/s, limited to 1.4; zero
///                       disables it.
/// Error:   blur from the camera's translation, which matters for near points, is neglected.
void SetMotionBlur(const Camera& camera,
                   const RotationRates& rates,
                   double blur_s_per_px,
                   std::vector<Track>& tracks);

}  // namespace rotslam
