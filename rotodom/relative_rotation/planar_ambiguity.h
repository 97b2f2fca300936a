#pragma once

#include <optional>

#include "rotodom/relative_rotation/pair_arrays.h"

namespace rotslam {

/// The other motion that shows the plane on which most of the agreeing pairs lie in the same
/// places: the homography R + t n^T of two views has two decompositions whose points lie before the
/// cameras or behind them together. Descents from one do not lead to the other, which may be tens
/// of degrees away.
/// @param pairs      those whose distance under `model` is below `threshold` are asked.
/// @param threshold  rad; no plane is told more finely.
/// @return  nullopt where there are too few of them, or where the plane shows no translation.
/// Cost:    20 us for 250 pairs.
/// Source:  Ma, Soatto, Kosecka & Sastry, An Invitation to 3-D Vision, 2004, sec. 5.3.3.
std::optional<EpipolarModel> PlanarAmbiguity(const PairArrays& pairs,
                                             const EpipolarModel& model,
                                             double threshold);

}  // namespace rotslam
