#pragma once

#include <cstdint>

namespace rotslam {

/// A pseudo-random number of 64 bits for every argument, the same on every machine.
/// Source: splitmix64; Steele, Lea & Flood, Fast Splittable Pseudorandom Number Generators, OOPSLA
///         2014.
constexpr std::uint64_t HashOf(std::uint64_t value) {
  std::uint64_t z = value + 0x9E3779B97F4A7C15ull;
  z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ull;
  z = (z ^ (z >> 27)) * 0x94D049BB133111EBull;
  return z ^ (z >> 31);
}

/// Random numbers with the same sequence on every machine, unlike those of the standard library's
/// distributions.
class SplitMix64 {
 public:
  explicit SplitMix64(std::uint64_t seed) : state_(seed) {}

  std::uint64_t Next() {
    const std::uint64_t number = HashOf(state_);
    state_ += 0x9E3779B97F4A7C15ull;
    return number;
  }
  /// In [0, limit), limit > 0; the bias is below limit / 2^64.
  std::uint64_t Below(std::uint64_t limit) { return Next() % limit; }
  /// In [0, count), count > 0.
  int Index(int count) { return static_cast<int>(Below(static_cast<std::uint64_t>(count))); }

 private:
  std::uint64_t state_;
};

}  // namespace rotslam
