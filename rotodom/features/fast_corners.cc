#include "rotodom/features/fast_corners.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "rotodom/features/cpu_features.h"

namespace rotslam {
namespace {

using Byte = std::uint8_t;

// Pixels of a row processed together. Loops over them have no branches, so that the compiler
// vectorises them.
constexpr int kChunk = 32;

// From a pixel to the 16 on the circle around it, in order.
using Circle = std::array<std::ptrdiff_t, 16>;

Circle CircleOffsets(std::ptrdiff_t step) {
  constexpr std::array<int, 16> kX = {0, 1, 2, 3, 3, 3, 2, 1, 0, -1, -2, -3, -3, -3, -2, -1};
  constexpr std::array<int, 16> kY = {3, 3, 2, 1, 0, -1, -2, -3, -3, -3, -2, -1, 0, 1, 2, 3};
  Circle circle = {};
  for (std::size_t k = 0; k < circle.size(); ++k) circle[k] = kY[k] * step + kX[k];
  return circle;
}

ROTSLAM_ALWAYS_INLINE Byte Min(Byte a, Byte b) { return a < b ? a : b; }
ROTSLAM_ALWAYS_INLINE Byte Max(Byte a, Byte b) { return a > b ? a : b; }

// How far `pixel` lies below `high` or above `low`, whichever is more; 0 when between them.
ROTSLAM_ALWAYS_INLINE Byte Difference(Byte pixel, Byte high, Byte low) {
  const Byte below = static_cast<Byte>(Max(high, pixel) - pixel);
  const Byte above = static_cast<Byte>(pixel - Min(low, pixel));
  return Max(below, above);
}

// Bound on the largest difference among the pixels from `p` on: nine in a row of the circle hold
// two neighbours of its four ends.
ROTSLAM_ALWAYS_INLINE Byte LargestPossibleDifference(const Byte* p, const Circle& circle) {
  const Byte* p0 = p + circle[0];
  const Byte* p4 = p + circle[4];
  const Byte* p8 = p + circle[8];
  const Byte* p12 = p + circle[12];
  Byte largest = 0;
  for (int k = 0; k < kChunk; ++k) {
    const Byte high = Min(Max(p0[k], p8[k]), Max(p4[k], p12[k]));
    const Byte low = Max(Min(p0[k], p8[k]), Min(p4[k], p12[k]));
    largest = Max(largest, Difference(p[k], high, low));
  }
  return largest;
}

// Scores plus one of the pixels from `p` on; 0 for pixels that are no corners.
ROTSLAM_ALWAYS_INLINE void ScoreChunk(const Byte* p,
                                      const Circle& circle,
                                      Byte threshold,
                                      Byte* __restrict score) {
  std::array<const Byte*, 16> on = {};
  for (std::size_t k = 0; k < on.size(); ++k) on[k] = p + circle[k];
  for (int k = 0; k < kChunk; ++k) {
    const Byte q0 = on[0][k], q1 = on[1][k], q2 = on[2][k], q3 = on[3][k];
    const Byte q4 = on[4][k], q5 = on[5][k], q6 = on[6][k], q7 = on[7][k];
    const Byte q8 = on[8][k], q9 = on[9][k], q10 = on[10][k], q11 = on[11][k];
    const Byte q12 = on[12][k], q13 = on[13][k], q14 = on[14][k], q15 = on[15][k];
    // Smallest of two and of four in a row, from 1, 3, ... on. Two runs of nine share the eight
    // that start at an odd number; of their ninth pixels the better one counts.
    const Byte a1 = Min(q1, q2), a3 = Min(q3, q4), a5 = Min(q5, q6), a7 = Min(q7, q8);
    const Byte a9 = Min(q9, q10), a11 = Min(q11, q12), a13 = Min(q13, q14), a15 = Min(q15, q0);
    const Byte b1 = Min(a1, a3), b3 = Min(a3, a5), b5 = Min(a5, a7), b7 = Min(a7, a9);
    const Byte b9 = Min(a9, a11), b11 = Min(a11, a13), b13 = Min(a13, a15), b15 = Min(a15, a1);
    Byte high = Min(Min(b1, b5), Max(q0, q9));
    high = Max(high, Min(Min(b3, b7), Max(q2, q11)));
    high = Max(high, Min(Min(b5, b9), Max(q4, q13)));
    high = Max(high, Min(Min(b7, b11), Max(q6, q15)));
    high = Max(high, Min(Min(b9, b13), Max(q8, q1)));
    high = Max(high, Min(Min(b11, b15), Max(q10, q3)));
    high = Max(high, Min(Min(b13, b1), Max(q12, q5)));
    high = Max(high, Min(Min(b15, b3), Max(q14, q7)));
    // The same with largest and smallest exchanged.
    const Byte c1 = Max(q1, q2), c3 = Max(q3, q4), c5 = Max(q5, q6), c7 = Max(q7, q8);
    const Byte c9 = Max(q9, q10), c11 = Max(q11, q12), c13 = Max(q13, q14), c15 = Max(q15, q0);
    const Byte d1 = Max(c1, c3), d3 = Max(c3, c5), d5 = Max(c5, c7), d7 = Max(c7, c9);
    const Byte d9 = Max(c9, c11), d11 = Max(c11, c13), d13 = Max(c13, c15), d15 = Max(c15, c1);
    Byte low = Max(Max(d1, d5), Min(q0, q9));
    low = Min(low, Max(Max(d3, d7), Min(q2, q11)));
    low = Min(low, Max(Max(d5, d9), Min(q4, q13)));
    low = Min(low, Max(Max(d7, d11), Min(q6, q15)));
    low = Min(low, Max(Max(d9, d13), Min(q8, q1)));
    low = Min(low, Max(Max(d11, d15), Min(q10, q3)));
    low = Min(low, Max(Max(d13, d1), Min(q12, q5)));
    low = Min(low, Max(Max(d15, d3), Min(q14, q7)));
    const Byte difference = Difference(p[k], high, low);
    score[k] = difference > threshold ? difference : Byte{0};
  }
}

ROTSLAM_ALWAYS_INLINE void ScoreRowInline(
    const Byte* row, const Circle& circle, int count, Byte threshold, Byte* __restrict score) {
  for (int x = 0; x < count; x += kChunk) {
    if (LargestPossibleDifference(row + x, circle) > threshold) {
      ScoreChunk(row + x, circle, threshold, score + x);
    } else {
      std::memset(score + x, 0, kChunk);
    }
  }
}

void ScoreRowPlain(const Byte* row, const Circle& circle, int count, Byte threshold, Byte* score) {
  ScoreRowInline(row, circle, count, threshold, score);
}

ROTSLAM_TARGET_AVX2 void ScoreRowAvx2(
    const Byte* row, const Circle& circle, int count, Byte threshold, Byte* score) {
  ScoreRowInline(row, circle, count, threshold, score);
}

// Appends the pixels of a row whose scores exceed those of their eight neighbours. The three rows
// may be read from -1 to a chunk beyond `count`.
void AppendMaxima(const std::array<Byte*, 3>& rows,
                  int count,
                  const cv::Point& origin,
                  std::vector<FastCorner>& corners) {
  const Byte* above = rows[0];
  const Byte* here = rows[1];
  const Byte* below = rows[2];
  for (int x0 = 0; x0 < count; x0 += kChunk) {
    Byte any = 0;
    for (int k = 0; k < kChunk; ++k) any = static_cast<Byte>(any | here[x0 + k]);
    if (any == 0) continue;
    std::array<Byte, kChunk> is_maximum;
    for (int k = 0; k < kChunk; ++k) {
      const int x = x0 + k;
      const Byte of_above = Max(Max(above[x - 1], above[x]), above[x + 1]);
      const Byte of_below = Max(Max(below[x - 1], below[x]), below[x + 1]);
      const Byte of_here = Max(here[x - 1], here[x + 1]);
      is_maximum[k] = here[x] > Max(Max(of_above, of_below), of_here) ? Byte{1} : Byte{0};
    }
    for (int k0 = 0; k0 < kChunk; k0 += 8) {
      std::uint64_t eight = 0;
      std::memcpy(&eight, is_maximum.data() + k0, sizeof(eight));
      for (; eight != 0; eight &= eight - 1) {
        const int k = k0 + std::countr_zero(eight) / 8;
        corners.push_back({origin.x + x0 + k, origin.y, here[x0 + k] - 1});
      }
    }
  }
}

}  // namespace

std::vector<FastCorner> FindFastCorners(const cv::Mat& image, const cv::Rect& area, int threshold) {
  std::vector<FastCorner> corners;
  if (area.width <= 0 || area.height <= 0 || threshold >= 255) return corners;
  const auto score_row = HasAvx2() ? ScoreRowAvx2 : ScoreRowPlain;
  const Byte least = static_cast<Byte>(threshold);
  const Circle circle = CircleOffsets(static_cast<std::ptrdiff_t>(image.step));

  // The last chunk reaches beyond the area. Where it would also leave the image, it is scored from
  // a copy of the rows around it.
  const int whole = area.width / kChunk * kChunk;
  const int rest = area.width - whole;
  const bool copy = rest > 0 && area.x + whole + kChunk + 3 > image.cols;
  constexpr int kCopyStep = kChunk + 8;
  std::array<Byte, 7 * kCopyStep> copied = {};
  const Circle circle_in_copy = CircleOffsets(kCopyStep);

  // Three rows of scores, the newest last, with zeros around them.
  const int size = whole + 3 * kChunk;
  std::vector<Byte> scores(3 * static_cast<std::size_t>(size), 0);
  std::array<Byte*, 3> rows = {};
  for (std::size_t k = 0; k < rows.size(); ++k) rows[k] = scores.data() + k * size + kChunk;
  for (int y = area.y; y <= area.y + area.height; ++y) {
    std::rotate(rows.begin(), rows.begin() + 1, rows.end());
    if (y == area.y + area.height) {
      std::memset(rows[2], 0, static_cast<std::size_t>(area.width));
    } else {
      const Byte* row = image.ptr<Byte>(y) + area.x;
      score_row(row, circle, copy ? whole : area.width, least, rows[2]);
      if (copy) {
        for (int k = 0; k < 7; ++k) {
          std::memcpy(copied.data() + k * kCopyStep,
                      image.ptr<Byte>(y + k - 3) + area.x + whole - 3,
                      static_cast<std::size_t>(rest) + 6);
        }
        score_row(copied.data() + 3 * kCopyStep + 3, circle_in_copy, rest, least, rows[2] + whole);
      }
      std::memset(rows[2] + area.width, 0, kChunk);
    }
    if (y == area.y) continue;
    AppendMaxima(rows, area.width, cv::Point(area.x, y - 1), corners);
  }
  return corners;
}

}  // namespace rotslam
