#pragma once

#include <optional>

#include "rotodom/relative_rotation/pair_arrays.h"

namespace rotslam {

/// Second solution for a plane. Where most inliers lie on a plane, the homography R + t n^T of two
/// views has two decompositions with points in front of both cameras. They may differ by tens of
/// degrees, and descents from one do not reach the other.
/// @param pairs      pairs with a distance under `model` below `threshold` are used.
/// @param threshold  rad; also the accuracy to which the plane is fitted.
/// @return  nullopt where there are too few of them, or where the homography shows no translation.
/// Cost:    20 us for 250 pairs.
/// Source:  Ma, Soatto, Kosecka & Sastry, An Invitation to 3-D Vision, 2004, sec. 5.3.3.
std::optional<EpipolarModel> PlanarAmbiguity(const PairArrays& pairs,
                                             const EpipolarModel& model,
                                             double threshold);

}  // namespace rotslam
