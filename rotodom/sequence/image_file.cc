#include "rotodom/sequence/image_file.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <fstream>
#include <iterator>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "rotodom/sequence/crc32.h"
#include "rotodom/sequence/heif_file.h"
#include "rotodom/types/text_file.h"

namespace rotslam {
namespace {

using Bytes = std::vector<unsigned char>;

// Big-endian; the caller has checked that they are there.
std::uint32_t Number16At(const Bytes& bytes, std::size_t at) {
  return std::uint32_t{bytes[at]} << 8 | std::uint32_t{bytes[at + 1]};
}
std::uint32_t Number32At(const Bytes& bytes, std::size_t at) {
  return Number16At(bytes, at) << 16 | Number16At(bytes, at + 2);
}

bool Has(const Bytes& bytes, std::size_t at, std::string_view letters) {
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  return at <= text.size() && text.substr(at).starts_with(letters);
}

// ---- JPEG

bool IsJpeg(const Bytes& bytes) { return Has(bytes, 0, "\xff\xd8\xff"); }

// Pixels that the first frame header claims, where its entropy code is Huffman's; else 0.
std::uint64_t ClaimedPixelsOfJpeg(const Bytes& bytes) {
  // A segment: 0xff, its kind, two bytes of length that count themselves.
  for (std::size_t at = 2; at + 9 <= bytes.size() && bytes[at] == 0xff;) {
    const unsigned char kind = bytes[at + 1];
    if (kind >= 0xc0 && kind <= 0xc2) {
      return std::uint64_t{Number16At(bytes, at + 5)} * Number16At(bytes, at + 7);
    }
    at += 2 + Number16At(bytes, at + 2);
  }
  return 0;
}

// A file that ends before its end marker decodes to grey below the break. The marker must come
// behind the start of the last scan: a thumbnail in the header has markers of its own.
bool IsCutOffJpeg(const Bytes& bytes) {
  constexpr unsigned char kScan[] = {0xff, 0xda};
  constexpr unsigned char kEnd[] = {0xff, 0xd9};
  const auto scan = std::find_end(bytes.begin(), bytes.end(), std::begin(kScan), std::end(kScan));
  if (std::search(scan, bytes.end(), std::begin(kEnd), std::end(kEnd)) == bytes.end()) return true;
  // Each block of 8 x 8 pixels has a bit at least, which says that it is like the one before.
  constexpr std::uint64_t kMostPixelsPerByte = 8 * 64;
  return ClaimedPixelsOfJpeg(bytes) > kMostPixelsPerByte * bytes.size();
}

// ---- PNG

// Bytes of the pixels that a header chunk (IHDR) of 13 bytes at `at` claims, at least.
std::uint64_t ClaimedBytesOfPng(const Bytes& bytes, std::size_t at) {
  constexpr std::array<std::uint64_t, 7> kChannels = {1, 1, 3, 1, 2, 1, 4};  // by colour type
  const std::uint64_t pixels =
      std::uint64_t{Number32At(bytes, at) & 0x7fffffff} * (Number32At(bytes, at + 4) & 0x7fffffff);
  const std::uint64_t bits = bytes[at + 8] * kChannels[bytes[at + 9] % kChannels.size()];
  return pixels / 8 * std::min<std::uint64_t>(bits, 64);
}

bool IsPng(const Bytes& bytes) { return Has(bytes, 0, "\x89PNG\r\n\x1a\n"); }

// What is wrong with the chunks of a PNG file; empty when nothing is. The decoder takes damaged
// pixels for good ones, and complains on stderr by itself.
std::string DamageOfPng(const Bytes& bytes) {
  constexpr unsigned char kHeader[] = {'I', 'H', 'D', 'R'};
  constexpr unsigned char kEnd[] = {'I', 'E', 'N', 'D'};
  constexpr std::uint64_t kMostBytesPerByte = 1032;  // that deflate can make
  // A chunk is its length, type, that many bytes, and the CRC of type and bytes.
  for (std::size_t at = 8; at + 12 <= bytes.size();) {
    const std::size_t length = Number32At(bytes, at);
    if (length > bytes.size() - at - 12) break;
    const unsigned char* type = bytes.data() + at + 4;
    const std::string_view chunk(reinterpret_cast<const char*>(type), 4 + length);
    const bool is_critical = (type[0] & 0x20) == 0;
    if (is_critical && Crc32(chunk) != Number32At(bytes, at + 8 + length)) {
      return "PNG data are damaged (checksum)";
    }
    if (std::equal(kHeader, kHeader + 4, type) && length >= 13 &&
        ClaimedBytesOfPng(bytes, at + 8) > kMostBytesPerByte * bytes.size()) {
      break;
    }
    if (std::equal(kEnd, kEnd + 4, type)) return {};
    at += 12 + length;
  }
  return "PNG data are cut off";
}

// ---- WebP

// Little-endian; the caller has checked that they are there.
std::uint32_t LittleNumberAt(const Bytes& bytes, std::size_t at, int num_bytes) {
  std::uint32_t number = 0;
  for (int k = num_bytes - 1; k >= 0; --k) number = number << 8 | bytes[at + k];
  return number;
}

bool IsWebp(const Bytes& bytes) { return Has(bytes, 0, "RIFF") && Has(bytes, 8, "WEBP"); }

// Pixels that the header claims; else 0.
std::uint64_t ClaimedPixelsOfWebp(const Bytes& bytes) {
  // "RIFF", the file's length, "WEBP", then chunks: four letters, their length, that many bytes.
  constexpr std::size_t at = 20;
  if (bytes.size() < at + 10) return 0;
  if (Has(bytes, 12, "VP8X")) {
    return (std::uint64_t{1} + LittleNumberAt(bytes, at + 4, 3)) *
           (1 + LittleNumberAt(bytes, at + 7, 3));
  }
  if (bytes[at] == 0x2f) {  // without loss: two numbers of 14 bits
    const std::uint32_t bits = LittleNumberAt(bytes, at + 1, 4);
    return std::uint64_t{1 + (bits & 0x3fff)} * (1 + (bits >> 14 & 0x3fff));
  }
  if (!Has(bytes, at + 3, "\x9d\x01\x2a")) return 0;
  return std::uint64_t{LittleNumberAt(bytes, at + 6, 2) & 0x3fff} *
         (LittleNumberAt(bytes, at + 8, 2) & 0x3fff);
}

// One colour costs nothing a pixel, so that a small file may hold much; no photograph is like that.
bool IsCutOffWebp(const Bytes& bytes) {
  constexpr std::uint64_t kMostPixelsOfOneColour = std::uint64_t{1} << 24;
  constexpr std::uint64_t kMostPixelsPerByte = 8 * 64;
  return ClaimedPixelsOfWebp(bytes) >
         std::max(kMostPixelsOfOneColour, kMostPixelsPerByte * bytes.size());
}

// ---- any

// Whether the file begins as one of the formats that are read here. OpenCV would offer any other to
// whatever it was built with: GDAL's many formats, and a medical one whose reader ends the program
// at a file that it does not understand.
bool IsKnownFormat(const Bytes& bytes) {
  // A damaged WebP file goes on to the medical reader when it has its mark.
  if (IsWebp(bytes)) return ClaimedPixelsOfWebp(bytes) > 0 && !Has(bytes, 128, "DICM");
  const bool is_tiff = Has(bytes, 0, {"II\x2a\0", 4}) || Has(bytes, 0, {"MM\0\x2a", 4});
  const bool is_pnm = bytes.size() >= 3 && bytes[0] == 'P' && bytes[1] >= '1' && bytes[1] <= '6' &&
                      std::isspace(bytes[2]) != 0;
  return IsHeif(bytes) || IsJpeg(bytes) || IsPng(bytes) || is_tiff || is_pnm || Has(bytes, 0, "BM");
}

// ---- depth

// Share of the pixels that may lie outside of a range, at either end: dead and saturated ones.
constexpr double kRarePixels = 1e-3;

bool IsFloat(const cv::Mat& image) { return image.depth() == CV_32F || image.depth() == CV_64F; }

// The image without its transparency, if it has one.
cv::Mat ColoursOf(const cv::Mat& image) {
  cv::Mat colours = image;
  if (image.channels() == 4) cv::cvtColor(image, colours, cv::COLOR_BGRA2BGR);
  if (image.channels() == 2) cv::extractChannel(image, colours, 0);
  return colours;
}

double LargestOf(const cv::Mat& colours) {
  double largest = 0.0;
  cv::minMaxLoc(colours.reshape(1), nullptr, &largest);
  return largest;
}

// Some finite values of the image, evenly spread.
void AddSample(const cv::Mat& image, std::vector<float>& sample) {
  constexpr std::size_t kMostValues = 100'000;
  cv::Mat values;
  image.convertTo(values, CV_32F);
  values = values.reshape(1);
  const std::size_t step = values.total() / kMostValues + 1;
  const std::size_t columns = static_cast<std::size_t>(values.cols);
  for (std::size_t k = 0; k < values.total(); k += step) {
    const float value =
        values.at<float>(static_cast<int>(k / columns), static_cast<int>(k % columns));
    if (std::isfinite(value)) sample.push_back(value);
  }
}

double QuantileOf(std::vector<float>& sample, double share) {
  const auto place = sample.begin() + std::lround(share * static_cast<double>(sample.size() - 1));
  std::nth_element(sample.begin(), place, sample.end());
  return *place;
}

// The range of all but a few values; one unit wide where they are all the same.
PixelRange RangeOf(std::vector<float>& sample) {
  const double low = QuantileOf(sample, kRarePixels);
  const double high = QuantileOf(sample, 1.0 - kRarePixels);
  return {low, high > low ? high : low + 1.0};
}

// Brings a range to 0 to 255.
void ConvertToEightBits(const cv::Mat& values, const PixelRange& range, cv::Mat& scaled) {
  const double factor = 255.0 / (range.high - range.low);
  values.convertTo(scaled, CV_8U, factor, -factor * range.low);
}

// Finds the bits and the range of 16-bit pixels.
// @param sample  some of their values.
void FitIntegers(double largest, std::vector<float> sample, PixelScale& scale) {
  for (const int bits : {16, 14, 12, 10, 8}) {
    if (largest < static_cast<double>(1 << bits)) scale.bits = bits;
  }
  const double divisor = scale.bits == 16 ? 257.0 : static_cast<double>(1 << (scale.bits - 8));
  scale.integers = {0.0, 255.0 * divisor};
  // Less than 64 of 256 grey levels are too few for corners in half-lit parts.
  constexpr double kNarrow = 0.25;
  // The two ends stand for pixels without a measurement: borders of rectified images, overflow.
  std::erase_if(sample, [](float value) { return value == 0.0F || value == 65535.0F; });
  if (scale.bits == 8 || sample.empty()) return;
  const PixelRange used = RangeOf(sample);
  scale.is_narrow = used.high - used.low < kNarrow * scale.integers.high;
  if (scale.is_narrow) scale.integers = used;
}

DecodedImage Failed(std::string problem) { return {{}, std::move(problem)}; }

}  // namespace

PixelScale FindPixelScale(const std::vector<cv::Mat>& images) {
  double largest = -1.0;
  std::vector<float> integers;
  std::vector<float> floats;
  for (const cv::Mat& image : images) {
    if (image.depth() == CV_16U) {
      const cv::Mat colours = ColoursOf(image);
      largest = std::max(largest, LargestOf(colours));
      AddSample(colours, integers);
    }
    if (IsFloat(image)) AddSample(image, floats);
  }
  PixelScale scale;
  if (!integers.empty()) FitIntegers(largest, std::move(integers), scale);
  if (!floats.empty()) scale.floats = RangeOf(floats);
  return scale;
}

std::optional<std::string> Describe(const PixelScale& scale, int depth) {
  if (depth == CV_32F || depth == CV_64F) {
    return "pixels are floating-point numbers: " + FormatNumber("%.4g", scale.floats.low) + " to " +
           FormatNumber("%.4g", scale.floats.high) + " become 0 to 255";
  }
  if (depth != CV_16U) return std::nullopt;
  if (scale.is_narrow) {
    return "pixels are 16 bit but use only " + FormatNumber("%.0f", scale.integers.low) + " to " +
           FormatNumber("%.0f", scale.integers.high) + ": these become 0 to 255 in all frames";
  }
  if (scale.bits == 16) return "pixels are 16 bit: divided by 257";
  return "pixels are " + std::to_string(scale.bits) + " bit in 16: " +
         (scale.bits == 8 ? "taken as they are"
                          : "divided by " + std::to_string(1 << (scale.bits - 8)));
}

DecodedImage ToEightBits(cv::Mat image, const PixelScale& scale) {
  image = ColoursOf(image);
  if (image.depth() == CV_16U) {
    cv::Mat scaled;
    ConvertToEightBits(image, scale.integers, scaled);
    image = scaled;
  } else if (IsFloat(image)) {
    const int num_channels = image.channels();
    cv::Mat values;
    image.convertTo(values, CV_32F);
    values = values.reshape(1);
    cv::patchNaNs(values, scale.floats.low);
    // Infinite pixels have no place among integers.
    values = cv::min(cv::max(values, scale.floats.low), scale.floats.high);
    cv::Mat scaled;
    ConvertToEightBits(values, scale.floats, scaled);
    image = scaled.reshape(num_channels);
  }
  if (image.depth() == CV_8U && (image.channels() == 1 || image.channels() == 3)) {
    return {std::move(image), {}};
  }
  return Failed("pixels are neither 8 nor 16 bits nor floating-point, or not of 1 to 4 channels");
}

DecodedImage ToEightBits(cv::Mat image) {
  const PixelScale scale = FindPixelScale({image});
  return ToEightBits(std::move(image), scale);
}

DecodedImage DecodeImageBytes(const Bytes& bytes) {
  if (bytes.empty()) return Failed("file is empty");
  if (!IsKnownFormat(bytes)) return Failed("not a PNG, JPEG, TIFF, BMP, PNM, WebP or HEIC file");
  if (IsHeif(bytes)) return DecodeHeif(bytes);
  if (IsJpeg(bytes) && IsCutOffJpeg(bytes)) return Failed("JPEG data are cut off");
  if (IsPng(bytes)) {
    if (std::string damage = DamageOfPng(bytes); !damage.empty()) return Failed(std::move(damage));
  }
  if (IsWebp(bytes) && IsCutOffWebp(bytes)) return Failed("WebP data are cut off");
  cv::Mat image;
  try {
    image = cv::imdecode(bytes,
                         cv::IMREAD_ANYCOLOR | cv::IMREAD_ANYDEPTH | cv::IMREAD_IGNORE_ORIENTATION);
  } catch (const cv::Exception&) {
    image.release();  // such as a header that claims a size beyond OpenCV's limit
  }
  if (image.empty()) return Failed("image cannot be decoded");
  return {std::move(image), {}};
}

DecodedImage DecodeImageFile(const std::filesystem::path& file) {
  // A folder can be opened, too, and then says that it is of 2^63 bytes.
  std::error_code error;
  if (!std::filesystem::is_regular_file(file, error)) return Failed("file cannot be opened");
  std::ifstream stream(file, std::ios::binary | std::ios::ate);
  Bytes bytes;
  if (const std::streamoff size = stream.tellg(); size > 0) {
    bytes.resize(static_cast<std::size_t>(size));
    stream.seekg(0);
    stream.read(reinterpret_cast<char*>(bytes.data()), size);
  }
  if (!stream.is_open() || stream.bad()) return Failed("file cannot be opened");
  return DecodeImageBytes(bytes);
}

DecodedImage ReadImageFile(const std::filesystem::path& file, const PixelScale& scale) {
  DecodedImage decoded = DecodeImageFile(file);
  return decoded.image.empty() ? decoded : ToEightBits(std::move(decoded.image), scale);
}

DecodedImage ReadImageFile(const std::filesystem::path& file) {
  DecodedImage decoded = DecodeImageFile(file);
  return decoded.image.empty() ? decoded : ToEightBits(std::move(decoded.image));
}

}  // namespace rotslam
