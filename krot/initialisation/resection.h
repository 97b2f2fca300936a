#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "rotodom/types/triangulation.h"

namespace rotslam {

// The name differs from ba's ResectionOptions, since both are in namespace rotslam.
/// Options for the resection of a camera centre.
struct CenterResectionOptions {
  double threshold_rad = 0.0057;  // inlier angle; 4 px at f = 700
  int max_samples = 200;
  std::uint64_t seed = 1;
};

struct Resection {
  Eigen::Vector3d center_in_world;
  std::vector<int> inliers;  // positions in the input
};

/// Camera centre from known points and a known rotation. The centre lies on the line through each
/// point along its ray: d x (X - c) = 0, linear in c. Hypotheses come from random pairs of lines
/// and are scored by all lines; the best is refined by robust least squares of angles.
/// @param rays  from the known points, which stand as their centres, back to the unknown centre.
///              Their sigmas are ignored.
/// @return  nullopt when fewer than three lines agree or they do not determine the centre.
/// Error:   exact on exact input (1e-9 of the scene's size).
std::optional<Resection> ResectCenter(const std::vector<PosedRay>& rays,
                                      const CenterResectionOptions& options);

}  // namespace rotslam
