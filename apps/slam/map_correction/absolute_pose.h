#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "ba/resection.h"

namespace rotslam {

/// Pose of one frame against known points, from nowhere: consensus over triples of sightings, then
/// ResectFrame.
/// @param sightings  of which most may be wrong; a keypoint may be there with several points.
/// @param options    of ResectFrame, whose inliers a pose must have.
/// @return  nullopt where no pose has these.
/// Error:   as ResectFrame's; eight in ten sightings may be outliers (relocalisation tests).
/// Cost:    up to 1,000 triples, each tried on all sightings: 50 ms for 300.
/// Source:  Fischler and Bolles, CACM 1981; triples by Ke and Roumeliotis, CVPR 2017, as OpenCV has
/// it.
std::optional<ResectedPose> FindAbsolutePose(const Camera& camera,
                                             const std::vector<PointSighting>& sightings,
                                             const ResectionOptions& options,
                                             std::uint64_t seed);

}  // namespace rotslam
