#pragma once

#include <optional>

#include "apps/slam/live/live_map.h"
#include "ba/resection.h"
#include "rotodom/camera/camera.h"
#include "rotodom/features/features.h"

namespace rotslam {

/// Pose of a frame by the points of a live map that it sees.
/// @param start  its rotation is known to `start.rotation_covariance`; its centre is where the
///               frame is expected.
/// @return  nullopt where too few points agree. First the centre alone is found, with the rotation
///          known and without a guess (ResectCenter). If fewer points agree with that than with
///          `start`, that of `start` is used. Then both are refined (ResectFrame).
/// Cost:    about a millisecond for 1,000 points.
std::optional<ResectedPose> FindLivePose(const LiveMap& map,
                                         const Features& features,
                                         const ResectionStart& start,
                                         const Camera& camera,
                                         const ResectionOptions& options);

}  // namespace rotslam
