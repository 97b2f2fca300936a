#pragma once

namespace rotslam {

/// Vector instructions of an x86-64 machine; on other machines there is only the baseline. Some
/// loops are compiled once for each level, all with identical results.
enum class SimdLevel { kBaseline, kAvx2, kAvx512 };

/// The level to use: the highest that this machine has, up to the limit.
SimdLevel UsedSimdLevel();

/// Sets the limit, which is kAvx512 unless the environment variable ROTSLAM_SIMD is `baseline` or
/// `avx2`. For tests that compare the levels.
void LimitSimdLevel(SimdLevel highest);

}  // namespace rotslam
