#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "ba/resection.h"

namespace rotslam {

/// Pose of one frame from known points without a start: consensus over triples of observations,
/// then ResectFrame.
/// @param observations  most of them may be wrong; a keypoint may occur with several points.
/// @param options    of ResectFrame; a pose must reach its number of inliers.
/// @return  nullopt where no pose reaches it.
/// Error:   as ResectFrame's; eight in ten observations may be outliers (relocalisation tests).
/// Cost:    up to 1,000 triples, each tried on all observations: 50 ms for 300.
/// Source:  Fischler and Bolles, CACM 1981; triples by Ke and Roumeliotis, CVPR 2017, as OpenCV has
/// it.
std::optional<ResectedPose> FindAbsolutePose(const Camera& camera,
                                             const std::vector<PointObservation2D3D>& observations,
                                             const ResectionOptions& options,
                                             std::uint64_t seed);

}  // namespace rotslam
