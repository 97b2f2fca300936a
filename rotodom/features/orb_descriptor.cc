#include "rotodom/features/orb_descriptor.h"

#include <array>
#include <bit>
#include <cmath>
#include <cstring>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

#include "rotodom/features/cpu_features.h"
#include "rotodom/features/orb_pattern.h"

namespace rotslam {
namespace {

constexpr int kPairs = 256;  // comparisons of pixels, one bit each

// The disc's rows as weights of the 32 pixels that start kOrbHalfPatch left of the centre: 1
// inside, 0 outside. Symmetric about the diagonal, as in ORB.
using DiscMask = std::array<std::array<std::int16_t, 32>, kOrbHalfPatch + 1>;

DiscMask MakeDiscMask() {
  std::array<int, kOrbHalfPatch + 1> half_width = {};
  const int diagonal = static_cast<int>(std::floor(kOrbHalfPatch * std::sqrt(0.5) + 1.0));
  for (int v = 0; v <= diagonal; ++v) {
    half_width[v] =
        static_cast<int>(std::lround(std::sqrt(double(kOrbHalfPatch * kOrbHalfPatch - v * v))));
  }
  int width = 0;
  for (int v = kOrbHalfPatch; v >= diagonal; --v) {
    while (half_width[width] == half_width[width + 1]) ++width;
    half_width[v] = width++;
  }
  DiscMask mask = {};
  for (int v = 0; v <= kOrbHalfPatch; ++v) {
    for (int u = -half_width[v]; u <= half_width[v]; ++u) mask[v][u + kOrbHalfPatch] = 1;
  }
  return mask;
}

// x and y of all first points, then of all second points.
struct PatternLists {
  std::array<float, 2 * kPairs> x;
  std::array<float, 2 * kPairs> y;
};

PatternLists MakePatternLists() {
  PatternLists lists = {};
  for (int k = 0; k < kPairs; ++k) {
    lists.x[k] = kOrbPattern[k][0];
    lists.y[k] = kOrbPattern[k][1];
    lists.x[kPairs + k] = kOrbPattern[k][2];
    lists.y[kPairs + k] = kOrbPattern[k][3];
  }
  return lists;
}

// Both moments of the disc. All sums but the last fit into 16 bits.
ROTSLAM_ALWAYS_INLINE void DiscMoments(
    const std::uint8_t* center, std::ptrdiff_t step, const DiscMask& mask, int& m_x, int& m_y) {
  std::array<std::int16_t, 32> sum;          // of each column
  std::array<std::int16_t, 32> moment = {};  // of each column, about the centre's row
  const std::uint8_t* row = center - kOrbHalfPatch;
  for (int k = 0; k < 32; ++k) sum[k] = static_cast<std::int16_t>(row[k] * mask[0][k]);
  for (int v = 1; v <= kOrbHalfPatch; ++v) {
    const std::uint8_t* above = row - v * step;
    const std::uint8_t* below = row + v * step;
    const std::int16_t* weights = mask[v].data();
    const std::int16_t distance = static_cast<std::int16_t>(v);
    for (int k = 0; k < 32; ++k) {
      const std::int16_t weight = weights[k];
      const std::int16_t both = static_cast<std::int16_t>(below[k] + above[k]);
      const std::int16_t difference = static_cast<std::int16_t>(below[k] - above[k]);
      sum[k] = static_cast<std::int16_t>(sum[k] + static_cast<std::int16_t>(weight * both));
      moment[k] = static_cast<std::int16_t>(
          moment[k] +
          static_cast<std::int16_t>(static_cast<std::int16_t>(weight * distance) * difference));
    }
  }
  m_x = 0;
  m_y = 0;
  for (int k = 0; k < 32; ++k) {
    m_x += (k - kOrbHalfPatch) * sum[k];
    m_y += moment[k];
  }
}

void DiscMomentsPlain(
    const std::uint8_t* center, std::ptrdiff_t step, const DiscMask& mask, int& m_x, int& m_y) {
  DiscMoments(center, step, mask, m_x, m_y);
}

ROTSLAM_TARGET_AVX2 void DiscMomentsAvx2(
    const std::uint8_t* center, std::ptrdiff_t step, const DiscMask& mask, int& m_x, int& m_y) {
  DiscMoments(center, step, mask, m_x, m_y);
}

// Rounds to the nearest integer, halves to even, by adding 1.5 * 2^23, which drops the fraction.
ROTSLAM_ALWAYS_INLINE int RoundSmall(float value) {
  constexpr float kShift = 12582912.0F;  // 1.5 * 2^23
  return std::bit_cast<int>(value + kShift) - std::bit_cast<int>(kShift);
}

ROTSLAM_ALWAYS_INLINE void TurnPattern(
    const PatternLists& pattern, float cosine, float sine, int step, int* __restrict offsets) {
  for (int k = 0; k < 2 * kPairs; ++k) {
    const float x = pattern.x[k] * cosine - pattern.y[k] * sine;
    const float y = pattern.x[k] * sine + pattern.y[k] * cosine;
    offsets[k] = RoundSmall(y) * step + RoundSmall(x);
  }
}

void TurnPatternPlain(
    const PatternLists& pattern, float cosine, float sine, int step, int* offsets) {
  TurnPattern(pattern, cosine, sine, step, offsets);
}

ROTSLAM_TARGET_AVX2 void TurnPatternAvx2(
    const PatternLists& pattern, float cosine, float sine, int step, int* offsets) {
  TurnPattern(pattern, cosine, sine, step, offsets);
}

// The kernel in units of 1/256 is 18 34 48 56 48 34 18. Column sums fit into 16 bits and sums of
// all pixels into 24, so that only the last step rounds. All columns are processed before all rows,
// because loading values that were just stored at another alignment is slow.
using BlurColumns = std::array<std::array<std::uint16_t, kBlurBlock + kBlurMargin>, kBlurBlock>;

void BlurBlockPlain(const std::uint8_t* from,
                    std::ptrdiff_t from_step,
                    std::uint8_t* to,
                    std::ptrdiff_t to_step) {
  BlurColumns columns;
  for (int row = 0; row < kBlurBlock; ++row) {
    std::array<const std::uint8_t*, 7> r;
    for (int k = 0; k < 7; ++k) r[k] = from + (row + k - 3) * from_step - kBlurReach;
    std::uint16_t* column = columns[row].data();
    for (int k = 0; k < kBlurBlock + kBlurMargin; ++k) {
      column[k] = static_cast<std::uint16_t>(18 * (r[0][k] + r[6][k]) + 34 * (r[1][k] + r[5][k]) +
                                             48 * (r[2][k] + r[4][k]) + 56 * r[3][k]);
    }
  }
  for (int row = 0; row < kBlurBlock; ++row) {
    const std::uint16_t* column = columns[row].data();
    std::uint8_t* out = to + row * to_step;
    for (int k = 0; k < kBlurBlock; ++k) {
      const int sum = 18 * (column[k] + column[k + 6]) + 34 * (column[k + 1] + column[k + 5]) +
                      48 * (column[k + 2] + column[k + 4]) + 56 * column[k + 3];
      out[k] = static_cast<std::uint8_t>((sum + (1 << 15)) >> 16);
    }
  }
}

#if defined(__x86_64__)
ROTSLAM_TARGET_AVX2 inline __m256i Load256(const void* from) {
  return _mm256_loadu_si256(static_cast<const __m256i*>(from));
}

// One row of column sums, less 2^15 so that they fit a signed number.
ROTSLAM_TARGET_AVX2 inline void BlurColumnsAvx2(const std::uint8_t* from,
                                                std::ptrdiff_t step,
                                                std::uint16_t* column) {
  const __m256i of_ends = _mm256_set1_epi8(18);
  const __m256i of_seconds = _mm256_set1_epi8(34);
  const __m256i of_thirds = _mm256_set1_epi8(48);
  const __m256i of_middle = _mm256_set1_epi8(56);
  const __m256i sign = _mm256_set1_epi16(std::int16_t{-32768});
  const __m256i r0 = Load256(from - 3 * step);
  const __m256i r1 = Load256(from - 2 * step);
  const __m256i r2 = Load256(from - step);
  const __m256i r3 = Load256(from);
  const __m256i r4 = Load256(from + step);
  const __m256i r5 = Load256(from + 2 * step);
  const __m256i r6 = Load256(from + 3 * step);
  __m256i low = _mm256_maddubs_epi16(_mm256_unpacklo_epi8(r0, r6), of_ends);
  __m256i high = _mm256_maddubs_epi16(_mm256_unpackhi_epi8(r0, r6), of_ends);
  low = _mm256_add_epi16(low, _mm256_maddubs_epi16(_mm256_unpacklo_epi8(r1, r5), of_seconds));
  high = _mm256_add_epi16(high, _mm256_maddubs_epi16(_mm256_unpackhi_epi8(r1, r5), of_seconds));
  low = _mm256_add_epi16(low, _mm256_maddubs_epi16(_mm256_unpacklo_epi8(r2, r4), of_thirds));
  high = _mm256_add_epi16(high, _mm256_maddubs_epi16(_mm256_unpackhi_epi8(r2, r4), of_thirds));
  const __m256i zero = _mm256_setzero_si256();
  low = _mm256_add_epi16(low, _mm256_maddubs_epi16(_mm256_unpacklo_epi8(r3, zero), of_middle));
  high = _mm256_add_epi16(high, _mm256_maddubs_epi16(_mm256_unpackhi_epi8(r3, zero), of_middle));
  low = _mm256_xor_si256(low, sign);
  high = _mm256_xor_si256(high, sign);
  // The halves of a register go separate ways: low has columns 0..7 and 16..23, high the others.
  auto* to = reinterpret_cast<__m256i*>(column);
  _mm256_storeu_si256(to, _mm256_permute2x128_si256(low, high, 0x20));
  _mm256_storeu_si256(to + 1, _mm256_permute2x128_si256(low, high, 0x31));
}

// Sums of seven of them in a row, from `column` on for sixteen pixels, divided by 2^16.
ROTSLAM_TARGET_AVX2 inline __m256i BlurRowAvx2(const std::uint16_t* column) {
  const __m256i of_ends = _mm256_set1_epi16(18);
  const __m256i of_seconds = _mm256_set1_epi16(34);
  const __m256i of_thirds = _mm256_set1_epi16(48);
  // The product of the second numbers is 2^15 * 257: what the sign took from the seven, and a half.
  const __m256i of_middle = _mm256_set1_epi32((-257 * (1 << 16)) | 56);
  const __m256i lowest = _mm256_set1_epi16(std::int16_t{-32768});
  const __m256i c0 = Load256(column + 0);
  const __m256i c1 = Load256(column + 1);
  const __m256i c2 = Load256(column + 2);
  const __m256i c3 = Load256(column + 3);
  const __m256i c4 = Load256(column + 4);
  const __m256i c5 = Load256(column + 5);
  const __m256i c6 = Load256(column + 6);
  __m256i low = _mm256_madd_epi16(_mm256_unpacklo_epi16(c0, c6), of_ends);
  __m256i high = _mm256_madd_epi16(_mm256_unpackhi_epi16(c0, c6), of_ends);
  low = _mm256_add_epi32(low, _mm256_madd_epi16(_mm256_unpacklo_epi16(c1, c5), of_seconds));
  high = _mm256_add_epi32(high, _mm256_madd_epi16(_mm256_unpackhi_epi16(c1, c5), of_seconds));
  low = _mm256_add_epi32(low, _mm256_madd_epi16(_mm256_unpacklo_epi16(c2, c4), of_thirds));
  high = _mm256_add_epi32(high, _mm256_madd_epi16(_mm256_unpackhi_epi16(c2, c4), of_thirds));
  low = _mm256_add_epi32(low, _mm256_madd_epi16(_mm256_unpacklo_epi16(c3, lowest), of_middle));
  high = _mm256_add_epi32(high, _mm256_madd_epi16(_mm256_unpackhi_epi16(c3, lowest), of_middle));
  return _mm256_packs_epi32(_mm256_srli_epi32(low, 16), _mm256_srli_epi32(high, 16));
}

ROTSLAM_TARGET_AVX2 void BlurBlockAvx2(const std::uint8_t* from,
                                       std::ptrdiff_t from_step,
                                       std::uint8_t* to,
                                       std::ptrdiff_t to_step) {
  static_assert(kBlurBlock == 32 && kBlurMargin == 8);
  BlurColumns columns;
  for (int row = 0; row < kBlurBlock; ++row) {
    const std::uint8_t* left = from + row * from_step - kBlurReach;
    BlurColumnsAvx2(left, from_step, columns[row].data());
    // The last 32 of the 40, most of them once more.
    BlurColumnsAvx2(left + kBlurMargin, from_step, columns[row].data() + kBlurMargin);
  }
  for (int row = 0; row < kBlurBlock; ++row) {
    const __m256i first = BlurRowAvx2(columns[row].data());
    const __m256i second = BlurRowAvx2(columns[row].data() + 16);
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(to + row * to_step),
                        _mm256_permute4x64_epi64(_mm256_packus_epi16(first, second), 0b11011000));
  }
}
#else
void BlurBlockAvx2(const std::uint8_t* from,
                   std::ptrdiff_t from_step,
                   std::uint8_t* to,
                   std::ptrdiff_t to_step) {
  BlurBlockPlain(from, from_step, to, to_step);
}
#endif

}  // namespace

float CentroidAngleDeg(const std::uint8_t* center, std::ptrdiff_t step) {
  static const DiscMask mask = MakeDiscMask();
  int m_x = 0;
  int m_y = 0;
  if (HasAvx2()) {
    DiscMomentsAvx2(center, step, mask, m_x, m_y);
  } else {
    DiscMomentsPlain(center, step, mask, m_x, m_y);
  }
  return std::atan2(static_cast<float>(m_y), static_cast<float>(m_x)) / kOrbRadPerDeg;
}

void ComputeOrbDescriptor(const std::uint8_t* blurred_center,
                          std::ptrdiff_t step,
                          float angle_deg,
                          std::uint8_t* descriptor) {
  static const PatternLists pattern = MakePatternLists();
  const float angle_rad = angle_deg * kOrbRadPerDeg;
  const float cosine = std::cos(angle_rad);
  const float sine = std::sin(angle_rad);
  std::array<int, 2 * kPairs> offsets;
  if (HasAvx2()) {
    TurnPatternAvx2(pattern, cosine, sine, static_cast<int>(step), offsets.data());
  } else {
    TurnPatternPlain(pattern, cosine, sine, static_cast<int>(step), offsets.data());
  }
  std::array<std::uint8_t, kPairs> first_is_darker;
  for (int k = 0; k < kPairs; ++k) {
    first_is_darker[k] = blurred_center[offsets[k]] < blurred_center[offsets[kPairs + k]] ? 1 : 0;
  }
  for (int byte = 0; byte < kPairs / 8; ++byte) {
    // Eight bytes of 0 or 1 to the bits of one: the product moves the k-th of them to bit 56 + k.
    std::uint64_t eight = 0;
    std::memcpy(&eight, first_is_darker.data() + std::ptrdiff_t{8} * byte, sizeof(eight));
    descriptor[byte] = static_cast<std::uint8_t>((eight * 0x0102040810204080U) >> 56);
  }
}

void BlurBlock(const std::uint8_t* from,
               std::ptrdiff_t from_step,
               std::uint8_t* to,
               std::ptrdiff_t to_step) {
  if (HasAvx2()) {
    BlurBlockAvx2(from, from_step, to, to_step);
  } else {
    BlurBlockPlain(from, from_step, to, to_step);
  }
}

}  // namespace rotslam
