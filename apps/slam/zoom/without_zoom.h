#pragma once

#include <cstdint>
#include <map>

#include "rotodom/camera/focal_scale.h"
#include "rotodom/masks/mask.h"
#include "rotodom/odometry.h"

namespace rotslam {

/// Keypoints where the camera would show them if its lens did not zoom; errors shrink with them.
void TakeZoomOut(const Camera& camera,
                 const FocalScales& scales,
                 std::map<FrameId, Features>& features);

/// The odometry of the same frames filmed with the camera as it is: keypoints, relative rotations
/// and orientations, without tracking again (ThroughLens).
/// Cost:    a relative rotation for each edge.
OdometryResult WithoutZoom(const OdometryResult& filmed,
                           const Camera& camera,
                           const FocalScales& scales,
                           const OdometryOptions& options,
                           std::uint64_t seed,
                           int num_threads);

/// The image as the camera would have shown it without the zoom; what lies beyond the borders of
/// the one given is masked.
MaskedImage WithoutZoom(const MaskedImage& filmed, const Camera& camera, double scale);

}  // namespace rotslam
