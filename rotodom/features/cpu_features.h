#pragma once

namespace rotslam {

/// Whether this machine has AVX2. Some loops are compiled twice, with and without AVX2; both
/// variants give identical results.
inline bool HasAvx2() {
#if defined(__x86_64__)
  static const bool has = __builtin_cpu_supports("avx2") != 0;
  return has;
#else
  return false;
#endif
}

// Marks a function compiled for AVX2 but not for fused multiply-adds, which round differently.
#if defined(__x86_64__)
#define ROTSLAM_TARGET_AVX2 [[gnu::target("avx2")]]
#else
#define ROTSLAM_TARGET_AVX2
#endif

// Marks the common body of both.
#define ROTSLAM_ALWAYS_INLINE [[gnu::always_inline]] inline

}  // namespace rotslam
