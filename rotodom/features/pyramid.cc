#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <stdexcept>

#if defined(__SSE4_1__)
#include <smmintrin.h>
#endif

#include "rotodom/features/features.h"

namespace rotslam {
namespace {

// Row blending keeps 7 fractional bits; column weights have 14.
constexpr int kRowDigits = 7;
constexpr int kWeightDigits = 14;
constexpr int kOne = 1 << kWeightDigits;
// Output pixels computed together, and the blended input pixels loaded for them.
constexpr std::size_t kGroup = 4;
constexpr int kLoaded = 8;

// An output pixel's centre lies between the input pixel `first` and the next one.
struct Sample {
  int first;
  double of_next;  // the next one's weight
};

Sample SampleAt(int output, int input_size, int output_size) {
  const double scale = static_cast<double>(input_size) / output_size;
  const double position = std::max(0.0, (output + 0.5) * scale - 0.5);
  const int first = std::clamp(static_cast<int>(position), 0, std::max(0, input_size - 2));
  return {first, std::min(1.0, position - first)};
}

// Four output pixels: eight input pixels from `first` on, brought into pairs and weighted.
struct ColumnGroup {
  int first = 0;
  std::array<std::uint8_t, 16> bytes = {};            // of the eight, that make up the pairs
  std::array<std::int16_t, 2 * kGroup> weights = {};  // of each pair, sum 2^14
};

struct Columns {
  std::vector<int> first;           // by output pixel
  std::vector<int> of_next;         // times 2^14
  std::vector<ColumnGroup> groups;  // of whole fours; none where one needs more than eight
};

Columns PlanColumns(int input_size, int output_size) {
  Columns columns;
  for (int x = 0; x < output_size; ++x) {
    const Sample sample = SampleAt(x, input_size, output_size);
    columns.first.push_back(sample.first);
    columns.of_next.push_back(static_cast<int>(std::lround(sample.of_next * kOne)));
  }
  columns.groups.resize(static_cast<std::size_t>(output_size / kGroup));
  for (std::size_t g = 0; g < columns.groups.size(); ++g) {
    ColumnGroup& group = columns.groups[g];
    group.first = columns.first[g * kGroup];
    for (std::size_t k = 0; k < kGroup; ++k) {
      const int place = columns.first[g * kGroup + k] - group.first;
      if (place > kLoaded - 2) {
        columns.groups.clear();
        return columns;
      }
      for (std::size_t byte = 0; byte < 4; ++byte) {
        group.bytes[4 * k + byte] = static_cast<std::uint8_t>(2 * place + static_cast<int>(byte));
      }
      const int weight = columns.of_next[g * kGroup + k];
      group.weights[2 * k] = static_cast<std::int16_t>(kOne - weight);
      group.weights[2 * k + 1] = static_cast<std::int16_t>(weight);
    }
  }
  return columns;
}

// blended = (1 - of_next) * above + of_next * below, times 2^7.
void BlendRows(const std::uint8_t* above,
               const std::uint8_t* below,
               double of_next,
               int count,
               std::int16_t* __restrict blended) {
  const int weight = std::min(32767, static_cast<int>(std::lround(of_next * 32768.0)));
  int x = 0;
#if defined(__SSE4_1__)
  const __m128i weights = _mm_set1_epi16(static_cast<std::int16_t>(weight));
  for (; x + 8 <= count; x += 8) {
    const __m128i a =
        _mm_cvtepu8_epi16(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(above + x)));
    const __m128i b =
        _mm_cvtepu8_epi16(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(below + x)));
    const __m128i difference = _mm_slli_epi16(_mm_sub_epi16(b, a), kRowDigits);
    _mm_storeu_si128(
        reinterpret_cast<__m128i*>(blended + x),
        _mm_add_epi16(_mm_slli_epi16(a, kRowDigits), _mm_mulhrs_epi16(difference, weights)));
  }
#endif
  for (; x < count; ++x) {
    const int difference = (below[x] - above[x]) * (1 << kRowDigits);
    blended[x] = static_cast<std::int16_t>((above[x] << kRowDigits) +
                                           ((difference * weight + (1 << 14)) >> 15));
  }
}

constexpr int kDigits = kRowDigits + kWeightDigits;
constexpr int kHalf = 1 << (kDigits - 1);

// `blended` may be read kLoaded pixels beyond its end.
void BlendColumns(const std::int16_t* blended,
                  const Columns& columns,
                  std::uint8_t* __restrict output) {
  std::size_t x = 0;
#if defined(__SSE4_1__)
  const __m128i half = _mm_set1_epi32(kHalf);
  const auto four = [&](const ColumnGroup& group) __attribute__((always_inline)) {
    const __m128i eight = _mm_loadu_si128(reinterpret_cast<const __m128i*>(blended + group.first));
    const __m128i pairs = _mm_shuffle_epi8(
        eight, _mm_loadu_si128(reinterpret_cast<const __m128i*>(group.bytes.data())));
    const __m128i sums = _mm_madd_epi16(
        pairs, _mm_loadu_si128(reinterpret_cast<const __m128i*>(group.weights.data())));
    return _mm_srai_epi32(_mm_add_epi32(sums, half), kDigits);
  };
  for (std::size_t g = 0; g + 4 <= columns.groups.size(); g += 4, x += 4 * kGroup) {
    const ColumnGroup* group = columns.groups.data() + g;
    const __m128i low = _mm_packs_epi32(four(group[0]), four(group[1]));
    const __m128i high = _mm_packs_epi32(four(group[2]), four(group[3]));
    _mm_storeu_si128(reinterpret_cast<__m128i*>(output + x), _mm_packus_epi16(low, high));
  }
#endif
  for (; x < columns.first.size(); ++x) {
    const std::int16_t* pair = blended + columns.first[x];
    const int weight = columns.of_next[x];
    output[x] = static_cast<std::uint8_t>((pair[0] * (kOne - weight) + pair[1] * weight + kHalf) >>
                                          kDigits);
  }
}

// Bilinear: each output pixel blends the four input pixels around its centre.
cv::Mat Shrink(const cv::Mat& input, const cv::Size& size) {
  cv::Mat output(size, CV_8UC1);
  const Columns columns = PlanColumns(input.cols, size.width);
  std::vector<std::int16_t> blended(static_cast<std::size_t>(input.cols) + kLoaded, 0);
  for (int y = 0; y < size.height; ++y) {
    const Sample sample = SampleAt(y, input.rows, size.height);
    const int next = std::min(sample.first + 1, input.rows - 1);
    BlendRows(input.ptr<std::uint8_t>(sample.first),
              input.ptr<std::uint8_t>(next),
              sample.of_next,
              input.cols,
              blended.data());
    BlendColumns(blended.data(), columns, output.ptr<std::uint8_t>(y));
  }
  return output;
}

}  // namespace

Eigen::Vector2d ImagePyramid::ToLevel(const Eigen::Vector2d& image_px, int level) const {
  return (image_px.array() + 0.5).cwiseQuotient(scales[level].array()) - 0.5;
}

Eigen::Vector2d ImagePyramid::ToImage(const Eigen::Vector2d& level_px, int level) const {
  return (level_px.array() + 0.5).cwiseProduct(scales[level].array()) - 0.5;
}

ImagePyramid BuildPyramid(const cv::Mat& grey, const FeatureOptions& options, const Mask& mask) {
  if (const auto problem = options.Problem()) {
    throw std::invalid_argument("FeatureOptions: " + *problem);
  }
  if (grey.empty() || grey.type() != CV_8UC1) {
    throw std::invalid_argument("BuildPyramid: the image must be 8-bit grey");
  }
  if (!mask.IsEmpty() && mask.size() != grey.size()) {
    throw std::invalid_argument("BuildPyramid: the mask has not the image's size");
  }
  ImagePyramid pyramid;
  pyramid.mask = mask;
  pyramid.levels.push_back(grey);
  pyramid.scales.emplace_back(1.0, 1.0);
  for (int level = 1; level < options.num_levels; ++level) {
    const double scale = std::pow(options.scale_factor, level);
    const cv::Size size(std::max(1, static_cast<int>(std::lround(grey.cols / scale))),
                        std::max(1, static_cast<int>(std::lround(grey.rows / scale))));
    pyramid.levels.push_back(Shrink(pyramid.levels.back(), size));
    pyramid.scales.emplace_back(static_cast<double>(grey.cols) / size.width,
                                static_cast<double>(grey.rows) / size.height);
  }
  return pyramid;
}

}  // namespace rotslam
