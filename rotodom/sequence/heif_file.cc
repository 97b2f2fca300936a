#include "rotodom/sequence/heif_file.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <string_view>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#ifdef ROTSLAM_WITH_HEIF
#include <libheif/heif.h>
#endif

namespace rotslam {
namespace {

DecodedImage NoHeif(const std::string& problem) { return {{}, problem}; }

#ifdef ROTSLAM_WITH_HEIF

template <class T>
using HeifPointer = std::unique_ptr<T, void (*)(T*)>;

// A coded block of 64 x 64 pixels takes a fraction of a bit where nothing changes.
constexpr std::uint64_t kMostPixelsOfAnyHeif = std::uint64_t{1} << 24;
constexpr std::uint64_t kMostPixelsPerByteOfHeif = 8 * 64 * 64;

void FreeHeifContext(heif_context* context) { heif_context_free(context); }
void FreeHeifHandle(heif_image_handle* handle) { heif_image_handle_release(handle); }
void FreeHeifImage(heif_image* image) { heif_image_release(image); }
void FreeHeifOptions(heif_decoding_options* options) { heif_decoding_options_free(options); }

DecodedImage DecodeWithLibheif(const std::vector<unsigned char>& bytes) {
  const HeifPointer<heif_context> context(heif_context_alloc(), FreeHeifContext);
  heif_error error = heif_context_read_from_memory_without_copy(
      context.get(), bytes.data(), bytes.size(), nullptr);
  if (error.code != heif_error_Ok) return NoHeif("HEIF data are damaged or cut off");
  heif_image_handle* found = nullptr;
  error = heif_context_get_primary_image_handle(context.get(), &found);
  const HeifPointer<heif_image_handle> handle(found, FreeHeifHandle);
  if (error.code != heif_error_Ok) return NoHeif("HEIF file has no image");
  const int claimed_width = heif_image_handle_get_width(handle.get());
  const int claimed_height = heif_image_handle_get_height(handle.get());
  if (claimed_width <= 0 || claimed_height <= 0 ||
      std::uint64_t{static_cast<unsigned>(claimed_width)} * static_cast<unsigned>(claimed_height) >
          std::max(kMostPixelsOfAnyHeif, kMostPixelsPerByteOfHeif * bytes.size())) {
    return NoHeif("HEIF data are cut off");
  }
  const HeifPointer<heif_decoding_options> options(heif_decoding_options_alloc(), FreeHeifOptions);
  options->ignore_transformations = 1;
  options->convert_hdr_to_8bit = 1;
  heif_image* decoded = nullptr;
  error = heif_decode_image(
      handle.get(), &decoded, heif_colorspace_RGB, heif_chroma_interleaved_RGB, options.get());
  const HeifPointer<heif_image> image(decoded, FreeHeifImage);
  if (error.code == heif_error_Unsupported_filetype ||
      error.code == heif_error_Unsupported_feature ||
      error.code == heif_error_Plugin_loading_error) {
    return NoHeif(
        "libheif has no decoder for this file (Debian: libheif-plugin-libde265 for HEIC, "
        "libheif-plugin-dav1d for AVIF)");
  }
  if (error.code != heif_error_Ok) return NoHeif("HEIF data are damaged or cut off");
  const int width = heif_image_get_width(image.get(), heif_channel_interleaved);
  const int height = heif_image_get_height(image.get(), heif_channel_interleaved);
  int stride = 0;
  const std::uint8_t* pixels =
      heif_image_get_plane_readonly(image.get(), heif_channel_interleaved, &stride);
  if (pixels == nullptr || width <= 0 || height <= 0 || stride < 3 * width) {
    return NoHeif("HEIF image cannot be decoded");
  }
  cv::Mat bgr(height, width, CV_8UC3);
  for (int row = 0; row < height; ++row) {
    const std::uint8_t* from = pixels + static_cast<std::ptrdiff_t>(row) * stride;
    for (int column = 0; column < width; ++column, from += 3) {
      bgr.at<cv::Vec3b>(row, column) = {from[2], from[1], from[0]};
    }
  }
  return {std::move(bgr), {}};
}

#endif

}  // namespace

bool IsHeif(const std::vector<unsigned char>& bytes) {
  // A box: its length, "ftyp", the main brand.
  constexpr std::array<std::string_view, 9> kBrands = {
      "heic", "heix", "heim", "heis", "hevc", "mif1", "msf1", "avif", "avis"};
  if (bytes.size() < 12) return false;
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  return text.substr(4, 4) == "ftyp" &&
         std::find(kBrands.begin(), kBrands.end(), text.substr(8, 4)) != kBrands.end();
}

DecodedImage DecodeHeif(const std::vector<unsigned char>& bytes) {
#ifdef ROTSLAM_WITH_HEIF
  try {
    return DecodeWithLibheif(bytes);
  } catch (const std::exception&) {
    return NoHeif("HEIF image cannot be decoded");
  }
#else
  static_cast<void>(bytes);
  return NoHeif(
      "HEIC and AVIF are not read by this build (it lacks libheif); convert them: "
      "heif-convert in.heic out.png");
#endif
}

}  // namespace rotslam
