#pragma once

#include "rotodom/simd/simd_level.h"

namespace rotslam {

/// Whether loops compiled for AVX2 may be used. They are compiled twice, with and without AVX2;
/// both variants give identical results.
inline bool HasAvx2() { return UsedSimdLevel() >= SimdLevel::kAvx2; }

// Marks a function compiled for AVX2 but not for fused multiply-adds, which round differently.
#if defined(__x86_64__)
#define ROTSLAM_TARGET_AVX2 [[gnu::target("avx2")]]
#else
#define ROTSLAM_TARGET_AVX2
#endif

// Marks the common body of both.
#define ROTSLAM_ALWAYS_INLINE [[gnu::always_inline]] inline

}  // namespace rotslam
