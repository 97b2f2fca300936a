#pragma once

#include <optional>
#include <vector>

#include "ba/resection.h"
#include "ba/zoom/zoomed_projection.h"
#include "rotodom/camera/camera.h"

namespace rotslam {

/// A frame that was resected together with its focal length.
struct FocalResection {
  ZoomedPose pose;
  double log_scale_sigma = 0.0;  // deviation, if errors of keypoints are independent
  double noise_px = 0.0;         // of the keypoints, per image axis, by the median residual
  int num_inliers = 0;           // within three of that
};

/// Finds the pose of a frame and its focal length by known points: robust Gauss-Newton from a start
/// that is off by some pixels in common.
/// @param camera        of the points' other views; its principal point and distortion hold.
/// @param observations  as the zoomed image shows them; their sigmas and blurs are not used.
/// @param moves         false: the centre stays, and the points may be directions from it.
/// @return  nullopt with fewer than 20 inliers, or when they leave the focal length open.
/// Error:   0.1 % of the focal length for 500 points at 0.3 px (tests of FollowZoom).
std::optional<FocalResection> ResectWithFocal(const Camera& camera,
                                              const std::vector<PointObservation2D3D>& observations,
                                              const ZoomedPose& start,
                                              bool moves);

}  // namespace rotslam
