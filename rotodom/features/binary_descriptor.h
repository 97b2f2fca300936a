#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <vector>

#include <opencv2/core/mat.hpp>

namespace rotslam {

/// 256 bits in the byte order of an ORB descriptor of 32 bytes.
using BinaryDescriptor = std::array<std::uint64_t, 4>;
inline constexpr int kDescriptorBytes = 32;

/// Number of differing bits, 0 to 256.
inline int HammingDistance(const BinaryDescriptor& a, const BinaryDescriptor& b) {
  return std::popcount(a[0] ^ b[0]) + std::popcount(a[1] ^ b[1]) + std::popcount(a[2] ^ b[2]) +
         std::popcount(a[3] ^ b[3]);
}

/// Converts the rows of `Features::descriptors`.
/// @param rows  n x 32 bytes, or empty; throws std::invalid_argument for another shape.
std::vector<BinaryDescriptor> ToBinaryDescriptors(const cv::Mat& rows);

}  // namespace rotslam
