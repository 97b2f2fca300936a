#pragma once

#include <cmath>

namespace rotslam {

/// How far from 1 the length of a quaternion in a file may be: files round.
inline constexpr double kMaxLengthError = 1e-2;

/// Whether a quaternion out of a file is of unit length, as far as files round; false where a
/// number is none.
inline bool IsUnitLength(double length) { return std::abs(length - 1.0) < kMaxLengthError; }

}  // namespace rotslam
