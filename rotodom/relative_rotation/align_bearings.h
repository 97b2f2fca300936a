#pragma once

#include <optional>
#include <span>

#include "rotodom/relative_rotation/bearing_pair.h"
#include "rotodom/types/rotation.h"

namespace rotslam {

/// Rotation that best aligns the pairs' bearings, R f_i ~ f_j (least squares).
/// @return  nullopt for fewer than two pairs or bearings that are all parallel.
/// Source:  Kabsch/Wahba by singular value decomposition.
std::optional<Rotation> AlignBearings(std::span<const BearingPair> pairs);

}  // namespace rotslam
