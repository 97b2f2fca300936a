// HEIC and AVIF, written by libheif where it has an encoder.

#include <fstream>
#include <iterator>
#include <memory>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "rotodom/sequence/sequence.h"
#include "tests/rotodom/sequence/scratch_folder.h"

#ifdef ROTSLAM_WITH_HEIF
#include <libheif/heif.h>
#endif

namespace rotslam {
namespace {

class HeifTest : public ScratchFolderTest {};

#ifdef ROTSLAM_WITH_HEIF

// Left half red, right half blue. False where libheif has no encoder.
bool WriteHeif(const std::filesystem::path& file,
               heif_compression_format format,
               int width,
               int height) {
  const std::unique_ptr<heif_context, void (*)(heif_context*)> context(heif_context_alloc(),
                                                                       heif_context_free);
  heif_encoder* encoder = nullptr;
  if (heif_context_get_encoder_for_format(context.get(), format, &encoder).code != heif_error_Ok) {
    return false;
  }
  heif_image* image = nullptr;
  heif_image_create(width, height, heif_colorspace_RGB, heif_chroma_interleaved_RGB, &image);
  heif_image_add_plane(image, heif_channel_interleaved, width, height, 8);
  int stride = 0;
  std::uint8_t* pixels = heif_image_get_plane(image, heif_channel_interleaved, &stride);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      std::uint8_t* pixel = pixels + y * stride + 3 * x;
      pixel[0] = x < width / 2 ? 255 : 0;
      pixel[1] = 0;
      pixel[2] = x < width / 2 ? 0 : 255;
    }
  }
  heif_image_handle* handle = nullptr;
  const heif_error error =
      heif_context_encode_image(context.get(), image, encoder, nullptr, &handle);
  heif_image_handle_release(handle);
  heif_image_release(image);
  heif_encoder_release(encoder);
  if (error.code != heif_error_Ok) return false;
  return heif_context_write_to_file(context.get(), file.c_str()).code == heif_error_Ok;
}

TEST_F(HeifTest, ReadsHeicAndAvif) {
  const bool has_heic = WriteHeif(folder_ / "0.HEIC", heif_compression_HEVC, 128, 96);
  const bool has_avif = WriteHeif(folder_ / "1.avif", heif_compression_AV1, 128, 96);
  if (!has_heic && !has_avif) GTEST_SKIP() << "libheif has no encoder here";
  const auto sequence = OpenSequence(folder_, {});
  EXPECT_EQ(sequence->image_size(), cv::Size(128, 96));
  while (const auto frame = sequence->Next()) {
    ASSERT_EQ(frame->image.type(), CV_8UC3) << frame->name << ": " << frame->problem;
    const auto left = frame->image.at<cv::Vec3b>(48, 20);
    const auto right = frame->image.at<cv::Vec3b>(48, 108);
    EXPECT_NEAR(left[2], 255, 8);
    EXPECT_NEAR(left[0], 0, 8);
    EXPECT_NEAR(right[2], 0, 8);
    EXPECT_NEAR(right[0], 255, 8);
  }
}

TEST_F(HeifTest, RefusesDamagedFilesInOneLine) {
  const auto file = folder_ / "0.heic";
  if (!WriteHeif(file, heif_compression_HEVC, 128, 96)) GTEST_SKIP() << "no encoder here";
  std::ifstream stream(file, std::ios::binary);
  const std::string whole{std::istreambuf_iterator<char>(stream), {}};
  WriteImage("1.png", cv::Scalar::all(0), CV_8UC1, {128, 96});
  for (std::size_t length = 0; length < whole.size(); length += whole.size() / 40) {
    WriteText("0.heic", whole.substr(0, length));
    const auto sequence = OpenSequence(folder_, {});
    EXPECT_NE(sequence->Next()->problem, "") << length;
  }
  for (std::size_t at = 0; at < whole.size(); at += whole.size() / 300 + 1) {
    std::string damaged = whole;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x55);
    WriteText("0.heic", damaged);
    const auto frame = OpenSequence(folder_, {})->Next();
    EXPECT_EQ(frame->image.empty(), !frame->problem.empty());
    EXPECT_EQ(frame->problem.find('\n'), std::string::npos);
  }
}

#else

TEST_F(HeifTest, SaysHowToConvert) {
  WriteText("0.heic", std::string("\0\0\0\x18", 4) + "ftypheic" + std::string(40, '\0'));
  WriteImage("1.png");
  EXPECT_THAT(OpenSequence(folder_, {})->Next()->problem,
              testing::HasSubstr("heif-convert in.heic out.png"));
}

#endif

}  // namespace
}  // namespace rotslam
