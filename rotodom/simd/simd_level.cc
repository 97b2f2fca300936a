#include "rotodom/simd/simd_level.h"

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <string_view>

namespace rotslam {
namespace {

SimdLevel MachineLevel() {
#if defined(__x86_64__)
  if (!__builtin_cpu_supports("avx2")) return SimdLevel::kBaseline;
  const bool has_avx512 = __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl") &&
                          __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512dq");
  return has_avx512 ? SimdLevel::kAvx512 : SimdLevel::kAvx2;
#else
  return SimdLevel::kBaseline;
#endif
}

SimdLevel LimitFromEnvironment() {
  const char* const variable = std::getenv("ROTSLAM_SIMD");  // NOLINT(concurrency-mt-unsafe)
  const std::string_view name = variable == nullptr ? "" : variable;
  if (name == "baseline") return SimdLevel::kBaseline;
  return name == "avx2" ? SimdLevel::kAvx2 : SimdLevel::kAvx512;
}

std::atomic<SimdLevel>& Limit() {
  static std::atomic<SimdLevel> limit = LimitFromEnvironment();
  return limit;
}

}  // namespace

SimdLevel UsedSimdLevel() {
  static const SimdLevel machine = MachineLevel();
  return std::min(machine, Limit().load(std::memory_order_relaxed));
}

void LimitSimdLevel(SimdLevel highest) { Limit() = highest; }

}  // namespace rotslam
