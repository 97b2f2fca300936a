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

/// How fast frames turn, rad/s in camera axes.
using RotationRates = std::map<FrameId, Eigen::Vector3d>;

/// Farther apart in time frames are no video: of stills nobody knows how they turned while they
/// were exposed.
inline constexpr double kFarthestFrame_s = 0.15;

/// The rate through a frame's orientation and the two of others that are nearest in time.
/// @param others      at different times; that of the frame itself does not count.
/// @param farthest_s  nor do those farther away.
/// @return  nullopt where none of them counts.
std::optional<Eigen::Vector3d> RateThrough(const TimedOrientation& frame,
                                           std::span<const TimedOrientation> others,
                                           double farthest_s = kFarthestFrame_s);

/// The same through the orientations next to a frame.
/// @param time_s  of each frame; ascending.
std::optional<Eigen::Vector3d> RateOf(FrameId frame,
                                      const RotationMap& cam_from_world,
                                      const std::function<double(FrameId)>& time_s,
                                      double farthest_s = kFarthestFrame_s);

/// Those of all frames that have one.
RotationRates RatesOf(const RotationMap& cam_from_world,
                      const std::function<double(FrameId)>& time_s);

/// What a turn makes of a keypoint while it is exposed, as in Observation::blur, however long.
/// @param rate            rad/s, in camera axes.
/// @param blur_s_per_px  its length by the speed of the image, px/s.
/// @return  zero where the camera does not see the bearing.
Eigen::Vector2d BlurVectorOf(const Camera& camera,
                             const Eigen::Vector3d& bearing,
                             const Eigen::Vector3d& rate,
                             double blur_s_per_px);

/// Says of each observation how its frame's turn blurs it (Observation::blur); of frames without
/// a rate nothing does.
/// @param blur_s_per_px  length of a blur by the speed of the image, px/s, up to 1.4; zero: none.
/// Error:   the camera's own movement, which blurs near points too, does not count.
void SetMotionBlur(const Camera& camera,
                   const RotationRates& rates,
                   double blur_s_per_px,
                   std::vector<Track>& tracks);

}  // namespace rotslam
