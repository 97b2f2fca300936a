#pragma once

#include <functional>
#include <map>
#include <vector>

#include <Eigen/Core>

#include "rotodom/camera/camera.h"
#include "rotodom/types/maps.h"
#include "rotodom/types/track.h"

namespace rotslam {

/// How fast frames turn, rad/s in camera axes.
using TurningRates = std::map<FrameId, Eigen::Vector3d>;

/// Rates through the orientations next to each frame. A frame of which none is within 0.15 s has no
/// rate: of stills nobody knows how they turned while they were exposed.
/// @param time_s  of each frame; ascending.
TurningRates RatesOf(const RotationMap& cam_from_world,
                     const std::function<double(FrameId)>& time_s);

/// Says of each observation how its frame's turn smears it (Observation::smear); of frames without
/// a rate nothing does.
/// @param smear_s_per_px  length of a smear by the speed of the image, px/s, up to 1.4; zero: none.
/// Error:   the camera's own movement, which smears near points too, does not count.
void SetSmears(const Camera& camera,
               const TurningRates& rates,
               double smear_s_per_px,
               std::vector<Track>& tracks);

}  // namespace rotslam
