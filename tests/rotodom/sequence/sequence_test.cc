#include "rotodom/sequence/sequence.h"

#include <bitset>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <initializer_list>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/videoio.hpp>

#include "tests/rotodom/sequence/scratch_folder.h"

namespace rotslam {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::SizeIs;

std::vector<Frame> ReadAll(Sequence& sequence) {
  std::vector<Frame> frames;
  while (std::optional<Frame> frame = sequence.Next()) frames.push_back(std::move(*frame));
  return frames;
}

std::vector<std::string> Names(const std::vector<Frame>& frames) {
  std::vector<std::string> names;
  for (const Frame& frame : frames) names.push_back(frame.name);
  return names;
}

class SequenceTest : public ScratchFolderTest {
 protected:
  std::string Complaint(const std::filesystem::path& path,
                        const SequenceOptions& options = {}) const {
    try {
      OpenSequence(path, options);
      return "no complaint";
    } catch (const std::runtime_error& error) {
      EXPECT_THAT(error.what(), testing::Not(HasSubstr("\n")));
      return error.what();
    }
  }

  // Ten images named by their number, each of a grey ten times its number.
  void WriteTen() const {
    for (int k = 0; k < 10; ++k) {
      WriteImage(std::to_string(k) + ".png", cv::Scalar::all(10 * k));
    }
  }

  // False where OpenCV has no encoder. Frame k is of a grey of 20 k.
  bool WriteVideo(const std::string& name, int num_frames, double fps) const {
    cv::VideoWriter writer;
    if (!writer.open((folder_ / name).string(),
                     cv::CAP_ANY,
                     cv::VideoWriter::fourcc('M', 'J', 'P', 'G'),
                     fps,
                     {64, 48})) {
      return false;
    }
    for (int k = 0; k < num_frames; ++k) {
      writer.write(cv::Mat(48, 64, CV_8UC3, cv::Scalar::all(20.0 * k)));
    }
    return true;
  }
};

TEST_F(SequenceTest, GivesEachFrameOnceInOrder) {
  WriteTen();
  const auto sequence = OpenSequence(folder_, {});
  EXPECT_EQ(sequence->NumFrames(), 10);
  EXPECT_EQ(sequence->image_size(), cv::Size(16, 12));
  EXPECT_THAT(sequence->Describe(), HasSubstr("image folder, 10 frames, 16x12, 0.3 s, "));
  const std::vector<Frame> frames = ReadAll(*sequence);
  ASSERT_EQ(frames.size(), 10u);
  for (int k = 0; k < 10; ++k) {
    EXPECT_EQ(frames[k].id, FrameId{k});
    EXPECT_EQ(frames[k].name, std::to_string(k) + ".png");
    EXPECT_DOUBLE_EQ(frames[k].timestamp_s, k / 30.0);
    EXPECT_EQ(frames[k].timestamp_s, sequence->timestamps_s()[k]);
    EXPECT_EQ(frames[k].problem, "");
    EXPECT_EQ(frames[k].image.type(), CV_8UC1);
    EXPECT_EQ(frames[k].image.at<unsigned char>(3, 4), 10 * k);
  }
  EXPECT_FALSE(sequence->Next());
}

TEST_F(SequenceTest, MayBeLeftInTheMiddle) {
  WriteTen();
  const auto sequence = OpenSequence(folder_, {});
  const std::optional<Frame> kept = sequence->Next();
  ASSERT_TRUE(sequence->Next());
  EXPECT_EQ(kept->image.at<unsigned char>(3, 4), 0);  // its pixels are its own
}

TEST_F(SequenceTest, Skips) {
  WriteTen();
  SequenceOptions options;
  options.first = 1;
  options.stride = 2;
  const auto sequence = OpenSequence(folder_, options);
  ASSERT_TRUE(sequence->Next());  // and the next one is being decoded
  sequence->Skip(2);
  const std::optional<Frame> frame = sequence->Next();
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->id, FrameId{3});
  EXPECT_EQ(frame->name, "7.png");
  EXPECT_EQ(frame->image.at<unsigned char>(3, 4), 70);
  sequence->Skip(100);
  EXPECT_FALSE(sequence->Next());
}

TEST_F(SequenceTest, NamesItsFiles) {
  WriteTen();
  SequenceOptions options;
  options.first = 2;
  options.stride = 5;
  EXPECT_THAT(OpenSequence(folder_, options)->Files(),
              ElementsAre(folder_ / "2.png", folder_ / "7.png"));
}

TEST_F(SequenceTest, TakesFirstLastAndStride) {
  WriteTen();
  SequenceOptions options;
  options.first = 2;
  options.last = 8;
  options.stride = 3;
  options.fps = 10.0;
  auto sequence = OpenSequence(folder_, options);
  EXPECT_EQ(sequence->NumFrames(), 3);
  EXPECT_THAT(sequence->timestamps_s(), ElementsAre(0.2, 0.5, 0.8));
  const std::vector<Frame> frames = ReadAll(*sequence);
  EXPECT_THAT(Names(frames), ElementsAre("2.png", "5.png", "8.png"));
  EXPECT_EQ(frames[2].id, FrameId{2});

  options = {};
  options.first = 8;
  options.last = 1000;  // beyond the end
  sequence = OpenSequence(folder_, options);
  EXPECT_THAT(Names(ReadAll(*sequence)), ElementsAre("8.png", "9.png"));

  options.last = std::numeric_limits<int>::max();
  options.stride = std::numeric_limits<int>::max();
  EXPECT_EQ(OpenSequence(folder_, options)->NumFrames(), 1);

  options.first = 10;
  EXPECT_THAT(Complaint(folder_, options),
              HasSubstr("first frame 10 asked for, but there are only 10"));
}

TEST_F(SequenceTest, GoesOnBehindAnUnreadableImage) {
  WriteTen();
  WriteText("0.png", "");
  WriteText("4.png", "no picture");
  WriteImage("6.png", cv::Scalar::all(0), CV_8UC1, {12, 16});
  const auto sequence = OpenSequence(folder_, {});
  EXPECT_EQ(sequence->image_size(), cv::Size(16, 12));
  const std::vector<Frame> frames = ReadAll(*sequence);
  ASSERT_EQ(frames.size(), 10u);
  EXPECT_EQ(frames[0].problem, "file is empty");
  EXPECT_EQ(frames[4].problem, "not a PNG, JPEG, TIFF, BMP, PNM, WebP or HEIC file");
  EXPECT_EQ(frames[6].problem, "image is 12x16, the first readable one is 16x12");
  for (const Frame& frame : frames) EXPECT_EQ(frame.image.empty(), !frame.problem.empty());
}

TEST_F(SequenceTest, NoticesCutOffFiles) {
  cv::Mat noise(120, 160, CV_8UC3);
  cv::theRNG().state = 7;
  cv::randu(noise, 0, 255);
  for (const std::string extension : {".jpg", ".png"}) {
    std::vector<unsigned char> bytes;
    ASSERT_TRUE(cv::imencode(extension, noise, bytes));
    const std::filesystem::path folder = folder_ / extension.substr(1);
    std::filesystem::create_directories(folder);
    for (const std::size_t size : {bytes.size(), bytes.size() / 2, bytes.size() / 50}) {
      std::ofstream(folder / (std::to_string(bytes.size() - size) + extension), std::ios::binary)
          .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(size));
    }
    const auto sequence = OpenSequence(folder, {});
    const std::vector<Frame> frames = ReadAll(*sequence);
    ASSERT_EQ(frames.size(), 3u);
    EXPECT_EQ(frames[0].problem, "");
    EXPECT_NE(frames[1].problem, "") << extension;
    EXPECT_NE(frames[2].problem, "") << extension;
  }
}

TEST_F(SequenceTest, NoticesDamagedPngFiles) {
  cv::Mat noise(60, 80, CV_8UC1);
  cv::theRNG().state = 7;
  cv::randu(noise, 0, 255);
  std::vector<unsigned char> bytes;
  ASSERT_TRUE(cv::imencode(".png", noise, bytes));
  const auto write = [&](const std::string& name) {
    WriteText(name, std::string(bytes.begin(), bytes.end()));
  };
  write("0.png");
  bytes[bytes.size() / 2] ^= 0x10;
  write("1.png");
  bytes[bytes.size() / 2] ^= 0x10;
  bytes.resize(bytes.size() - 12);  // the end chunk
  write("2.png");
  const auto sequence = OpenSequence(folder_, {});
  testing::internal::CaptureStderr();
  const std::vector<Frame> frames = ReadAll(*sequence);
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");  // the decoder has not been asked
  ASSERT_EQ(frames.size(), 3u);
  EXPECT_EQ(frames[0].problem, "");
  EXPECT_EQ(frames[1].problem, "PNG data are damaged (checksum)");
  EXPECT_EQ(frames[2].problem, "PNG data are cut off");
}

TEST_F(SequenceTest, MissingFilesOfAListAreUnreadableFrames) {
  WriteText("rgb.txt", "1.0 a.png\n2.0 b.png\n3.0 c.png\n");
  EXPECT_THAT(Complaint(folder_), HasSubstr("none of the 3 images can be read; a.png"));
  WriteImage("b.png");
  const auto sequence = OpenSequence(folder_, {});
  const std::vector<Frame> frames = ReadAll(*sequence);
  ASSERT_EQ(frames.size(), 3u);
  EXPECT_EQ(frames[0].problem, "file cannot be opened");
  EXPECT_FALSE(frames[1].image.empty());
  EXPECT_EQ(frames[2].timestamp_s, 3.0);
}

TEST_F(SequenceTest, AFolderInAListIsAnUnreadableFrame) {
  WriteText("rgb.txt", "1.0 a.png\n2.0 b.png\n");
  WriteImage("a.png");
  std::filesystem::create_directory(folder_ / "b.png");
  const auto sequence = OpenSequence(folder_, {});
  const std::vector<Frame> frames = ReadAll(*sequence);
  ASSERT_EQ(frames.size(), 2u);
  EXPECT_EQ(frames[1].problem, "file cannot be opened");
}

// As OpenCV cannot write them: four components, each all 128 but for the first where `is_inked`.
std::string CmykJpeg(int width, int height, bool is_inked) {
  const auto bytes = [](std::initializer_list<int> list) {
    return std::string(list.begin(), list.end());
  };
  std::string jpeg = bytes({0xff, 0xd8, 0xff, 0xdb, 0, 67, 0}) + std::string(64, 1);
  jpeg += bytes({0xff, 0xc0, 0, 20, 8, height / 256, height % 256, width / 256, width % 256, 4});
  for (int k = 1; k <= 4; ++k) jpeg += bytes({k, 0x11, 0});
  // Codes of DC differences: 0 for none, 10 for those of 11 bits; of AC: 0 for "the rest is zero".
  jpeg += bytes({0xff, 0xc4, 0, 21, 0x00, 1, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 11});
  jpeg += bytes({0xff, 0xc4, 0, 20, 0x10, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0});
  jpeg += bytes({0xff, 0xda, 0, 14, 4, 1, 0, 2, 0, 3, 0, 4, 0, 0, 63, 0});
  const int num_blocks = ((width + 7) / 8) * ((height + 7) / 8);
  std::string bits = is_inked ? "10011111111110" : "00";  // -1024 or no difference
  for (int k = 1; k < 4 * num_blocks; ++k) bits += "00";
  bits.resize((bits.size() + 7) / 8 * 8, '1');
  for (std::size_t at = 0; at < bits.size(); at += 8) {
    const int byte = static_cast<int>(std::bitset<8>(bits.substr(at, 8)).to_ulong());
    jpeg += bytes({byte});
    if (byte == 0xff) jpeg += bytes({0});
  }
  return jpeg + bytes({0xff, 0xd9});
}

// A small picture whose header says another size, all checksums right.
std::string PngThatSays(std::uint32_t width, std::uint32_t height) {
  std::vector<unsigned char> bytes;
  EXPECT_TRUE(cv::imencode(".png", cv::Mat::zeros(12, 16, CV_8UC1), bytes));
  const auto put = [&](std::size_t at, std::uint32_t value) {
    for (int k = 0; k < 4; ++k) bytes[at + k] = static_cast<unsigned char>(value >> (24 - 8 * k));
  };
  put(16, width);
  put(20, height);
  std::uint32_t crc = 0xffffffff;
  for (std::size_t at = 12; at < 29; ++at) {
    crc ^= bytes[at];
    for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ ((crc & 1) != 0 ? 0xedb88320 : 0);
  }
  put(29, ~crc);
  return {bytes.begin(), bytes.end()};
}

TEST_F(SequenceTest, TakesFourInks) {
  WriteText("0.jpg", CmykJpeg(40, 24, true));
  const std::vector<Frame> frames = ReadAll(*OpenSequence(folder_, {}));
  ASSERT_EQ(frames.size(), 1u);
  EXPECT_EQ(frames[0].problem, "");
  ASSERT_EQ(frames[0].image.type(), CV_8UC3);
  EXPECT_EQ(frames[0].image.size(), cv::Size(40, 24));
  // Adobe's inks are stored the wrong way round: 0 is all of the ink.
  const cv::Vec3b pixel = frames[0].image.at<cv::Vec3b>(10, 10);
  EXPECT_LT(pixel[2], pixel[1]);
}

TEST_F(SequenceTest, ReadsHundredMegapixels) {
  WriteImage("0.png", cv::Scalar::all(77), CV_8UC1, {11600, 8700});
  WriteImage("1.jpg", cv::Scalar::all(77), CV_8UC1, {11600, 8700});
  const std::vector<Frame> frames = ReadAll(*OpenSequence(folder_, {}));
  ASSERT_EQ(frames.size(), 2u);
  for (const Frame& frame : frames) {
    EXPECT_EQ(frame.problem, "");
    EXPECT_EQ(frame.image.size(), cv::Size(11600, 8700));
  }
}

// Of `image`, without loss and in a container, whose size its header then makes 16384 x 16384.
std::string LargestWebp(const cv::Mat& image) {
  std::vector<unsigned char> bytes;
  EXPECT_TRUE(cv::imencode(".webp", image, bytes, {cv::IMWRITE_WEBP_QUALITY, 101}));
  EXPECT_EQ(std::string(bytes.begin() + 12, bytes.begin() + 16), "VP8L");
  for (int k = 21; k < 24; ++k) bytes[k] = 0xff;
  bytes[24] |= 0x0f;
  return {bytes.begin(), bytes.end()};
}

// The files are whole but for the size in their headers, which is beyond what they can hold.
TEST_F(SequenceTest, BelievesNoSizeThatTheFileCannotHold) {
  std::string jpeg = CmykJpeg(40, 24, false);
  const std::size_t frame = jpeg.find("\xff\xc0");
  jpeg.replace(frame + 5, 4, "\x6f\xff\x6f\xff");
  WriteText("0.jpg", jpeg);
  WriteImage("1.png");
  WriteText("2.png", PngThatSays(28671, 28671));
  const std::string webp = LargestWebp(cv::Mat::zeros(12, 16, CV_8UC3));
  WriteText("3.webp", webp);
  const auto sequence = OpenSequence(folder_, {});
  const std::vector<Frame> frames = ReadAll(*sequence);
  ASSERT_EQ(frames.size(), 4u);
  EXPECT_EQ(frames[0].problem, "JPEG data are cut off");
  EXPECT_EQ(frames[1].problem, "");
  EXPECT_EQ(frames[2].problem, "PNG data are cut off");
  EXPECT_EQ(frames[3].problem, "WebP data are cut off");
}

// OpenCV's decoders of other formats may read further files, or end the program.
TEST_F(SequenceTest, OpensNoOtherFormats) {
  const std::string dicom = std::string(128, '\xdb') + "DICM\x42\x60\x29";
  std::string webp = LargestWebp(cv::Mat::zeros(12, 16, CV_8UC3)) + std::string(128, '\0');
  webp.replace(24, 1, std::string(1, '\0'));
  webp.replace(128, 4, "DICM");
  WriteText("0.png", dicom);
  WriteText("1.png", "<VRTDataset rasterXSize=\"8\" rasterYSize=\"8\"></VRTDataset>");
  WriteText("2.png", webp);
  WriteText("3.png", webp.replace(12, 4, "none"));
  for (const std::string format : {"4.png", "5.jpg", "6.tiff", "7.bmp", "8.pgm", "9.webp"}) {
    WriteImage(format);
  }
  const std::vector<Frame> frames = ReadAll(*OpenSequence(folder_, {}));
  ASSERT_EQ(frames.size(), 10u);
  for (int k = 0; k < 4; ++k) {
    EXPECT_EQ(frames[k].problem, "not a PNG, JPEG, TIFF, BMP, PNM, WebP or HEIC file") << k;
  }
  for (int k = 4; k < 10; ++k) EXPECT_EQ(frames[k].problem, "") << k;
}

TEST_F(SequenceTest, ReadsSmallFilesOfOneColour) {
  const cv::Mat image(1080, 1920, CV_8UC3, cv::Scalar(10, 20, 30));
  for (const int quality : {80, 101}) {  // with and without loss
    cv::imwrite((folder_ / (std::to_string(quality) + ".webp")).string(),
                image,
                {cv::IMWRITE_WEBP_QUALITY, quality});
  }
  const std::vector<Frame> frames = ReadAll(*OpenSequence(folder_, {}));
  ASSERT_EQ(frames.size(), 2u);
  for (const Frame& frame : frames) {
    EXPECT_EQ(frame.problem, "");
    EXPECT_EQ(frame.image.size(), image.size());
  }
}

TEST_F(SequenceTest, BringsEveryPixelFormatToEightBits) {
  WriteImage("0.png", cv::Scalar(10, 20, 30), CV_8UC3);
  WriteImage("1.png", cv::Scalar(10, 20, 30, 128), CV_8UC4);
  WriteImage("2.png", cv::Scalar(257.0 * 10, 257.0 * 20, 257.0 * 30), CV_16UC3);
  WriteImage("3.png", cv::Scalar(257.0 * 10), CV_16UC1);
  WriteImage("4.png", cv::Scalar(257.0 * 10, 257.0 * 20, 257.0 * 30, 65535.0), CV_16UC4);
  WriteImage("5.tiff", cv::Scalar(0.5), CV_32FC1);
  WriteImage("6.png", cv::Scalar(65534.0), CV_16UC1);
  const auto sequence = OpenSequence(folder_, {});
  EXPECT_EQ(sequence->image_size(), cv::Size(16, 12));
  const std::vector<Frame> frames = ReadAll(*sequence);
  ASSERT_EQ(frames.size(), 7u);
  for (const int k : {0, 1, 2, 4}) {
    ASSERT_EQ(frames[k].image.type(), CV_8UC3) << k << ": " << frames[k].problem;
    EXPECT_EQ(frames[k].image.at<cv::Vec3b>(3, 4), cv::Vec3b(10, 20, 30)) << k;
  }
  for (const int k : {3, 5}) ASSERT_EQ(frames[k].image.type(), CV_8UC1) << frames[k].problem;
  EXPECT_EQ(frames[3].image.at<unsigned char>(3, 4), 10);
}

// The largest value of the sequence, not of an image, tells the bits.
TEST_F(SequenceTest, FindsTheBitsOfPixelsOnceForTheSequence) {
  struct Case {
    double largest;
    double divisor;
    const char* note;
  };
  for (const Case& test : {Case{255, 1, "pixels are 8 bit in 16: taken as they are"},
                           Case{1000, 4, "pixels are 10 bit in 16: divided by 4"},
                           Case{4095, 16, "pixels are 12 bit in 16: divided by 16"},
                           Case{16000, 64, "pixels are 14 bit in 16: divided by 64"},
                           Case{65000, 257, "pixels are 16 bit: divided by 257"}}) {
    WriteImage("0.png", cv::Scalar(208), CV_16UC1);
    WriteImage("1.png", cv::Scalar(test.largest, 0, 208), CV_16UC3);
    WriteImage("2.png", cv::Scalar(0, 0, 0, 65535), CV_16UC4);
    const auto sequence = OpenSequence(folder_, {});
    EXPECT_THAT(sequence->notes(), testing::Contains(test.note));
    const std::vector<Frame> frames = ReadAll(*sequence);
    EXPECT_EQ(frames[0].image.at<unsigned char>(3, 4), std::lround(208 / test.divisor));
    EXPECT_EQ(frames[1].image.at<cv::Vec3b>(3, 4)[0],
              std::min(255L, std::lround(test.largest / test.divisor)));
    EXPECT_EQ(frames[1].image.at<cv::Vec3b>(3, 4)[2], std::lround(208 / test.divisor));
  }
}

// A thermal camera's counts: a few hundred of 16,384, in some frames less of them. The rectified
// image has a border of zeros, and a dead pixel is at the upper end.
TEST_F(SequenceTest, StretchesNarrowPixelsOnceForTheSequence) {
  cv::Mat ramp(40, 50, CV_16UC1);
  for (int k = 0; k < 2000; ++k) {
    ramp.at<std::uint16_t>(k / 50, k % 50) = static_cast<std::uint16_t>(7000 + k / 2);
  }
  ramp.row(0).setTo(0);
  ramp.at<std::uint16_t>(1, 1) = 16000;
  for (const char* name : {"0.png", "2.png"}) cv::imwrite((folder_ / name).string(), ramp);
  cv::imwrite((folder_ / "1.png").string(), cv::Mat(cv::min(ramp, 7500.0)));
  const auto sequence = OpenSequence(folder_, {});
  EXPECT_THAT(
      sequence->notes(),
      testing::Contains(testing::ContainsRegex(
          "pixels are 16 bit but use only 70[0-9][0-9] to 799[0-9]: these become 0 to 255")));
  const std::vector<Frame> frames = ReadAll(*sequence);
  ASSERT_EQ(frames.size(), 3u);
  for (const Frame& frame : frames) {
    EXPECT_EQ(frame.image.at<unsigned char>(0, 3), 0);
    EXPECT_NEAR(frame.image.at<unsigned char>(10, 0), 255 * 230 / 975, 2);
  }
  EXPECT_NEAR(frames[0].image.at<unsigned char>(39, 49), 255, 1);
  EXPECT_NEAR(frames[1].image.at<unsigned char>(39, 49), 255 * 480 / 975, 2);
}

TEST_F(SequenceTest, ScalesFloatingPointImagesAlike) {
  cv::Mat ramp(40, 50, CV_32FC1);
  for (int k = 0; k < 2000; ++k) ramp.at<float>(k / 50, k % 50) = static_cast<float>(k) / 2000.0F;
  cv::imwrite((folder_ / "0.tiff").string(), ramp);
  cv::imwrite((folder_ / "1.tiff").string(), cv::Mat(0.5F * ramp));
  ramp.at<float>(1, 1) = std::numeric_limits<float>::quiet_NaN();
  ramp.at<float>(1, 2) = std::numeric_limits<float>::infinity();
  ramp.at<float>(1, 3) = -1e30F;
  cv::imwrite((folder_ / "2.tiff").string(), ramp);
  const auto sequence = OpenSequence(folder_, {});
  EXPECT_THAT(sequence->notes(),
              testing::Contains(testing::StartsWith("pixels are floating-point numbers: ")));
  const std::vector<Frame> frames = ReadAll(*sequence);
  ASSERT_EQ(frames.size(), 3u);
  for (const Frame& frame : frames) ASSERT_EQ(frame.image.type(), CV_8UC1) << frame.problem;
  EXPECT_NEAR(frames[0].image.at<unsigned char>(20, 0), 127, 1);
  EXPECT_NEAR(frames[1].image.at<unsigned char>(20, 0), 64, 1);
  EXPECT_NEAR(frames[2].image.at<unsigned char>(20, 0), 127, 1);
  EXPECT_EQ(frames[2].image.at<unsigned char>(1, 1), 0);
  EXPECT_EQ(frames[2].image.at<unsigned char>(1, 2), 255);
  EXPECT_EQ(frames[2].image.at<unsigned char>(1, 3), 0);
}

// OpenCV writes colours as LogLuv, good to about one in a hundred.
TEST_F(SequenceTest, ReadsDoublesAndColourFloats) {
  WriteImage("0.tiff", cv::Scalar(0.0, 0.5, 1.0), CV_32FC3);
  WriteImage("1.tiff", cv::Scalar(1.0), CV_64FC1);
  const std::vector<Frame> frames = ReadAll(*OpenSequence(folder_, {}));
  ASSERT_EQ(frames.size(), 2u);
  ASSERT_EQ(frames[0].image.type(), CV_8UC3) << frames[0].problem;
  const auto pixel = frames[0].image.at<cv::Vec3b>(3, 4);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(pixel[c], 127.5 * c, 3.0);
  ASSERT_EQ(frames[1].image.type(), CV_8UC1) << frames[1].problem;
  EXPECT_NEAR(frames[1].image.at<unsigned char>(3, 4), 255, 3.0);
}

TEST_F(SequenceTest, RefusesTimestampsThatDoNotIncrease) {
  for (const char* name : {"a.png", "b.png", "c.png"}) WriteImage(name);
  WriteText("rgb.txt", "1.0 a.png\n2.5 b.png\n2.5 c.png\n");
  EXPECT_THAT(Complaint(folder_),
              testing::AllOf(HasSubstr("rgb.txt:3: c.png: timestamp 2.500000000 s is not later"),
                             HasSubstr("b.png in line 2")));
  WriteText("rgb.txt", "1.0 a.png\n0.5 b.png\n");
  EXPECT_THAT(Complaint(folder_), HasSubstr("b.png: timestamp 0.5"));
  SequenceOptions options;
  options.first = 1;  // the way round it
  EXPECT_EQ(OpenSequence(folder_, options)->NumFrames(), 1);
}

TEST_F(SequenceTest, RefusesOptionsOutOfRange) {
  WriteTen();
  const auto problem = [](int first, int last, int stride, double fps) {
    SequenceOptions options;
    options.first = first;
    options.last = last;
    options.stride = stride;
    options.fps = fps;
    return options.Problem().value_or("");
  };
  EXPECT_EQ(problem(0, -1, 1, 30.0), "");
  EXPECT_EQ(problem(3, 3, 1, 30.0), "");
  EXPECT_THAT(problem(-1, -1, 1, 30.0), HasSubstr("first is -1"));
  EXPECT_THAT(problem(0, -2, 1, 30.0), HasSubstr("last is -2"));
  EXPECT_THAT(problem(3, 2, 1, 30.0), HasSubstr("last is 2"));
  EXPECT_THAT(problem(0, -1, 0, 30.0), HasSubstr("stride is 0"));
  EXPECT_THAT(problem(0, -1, 1, 0.0), HasSubstr("fps is 0"));
  SequenceOptions options;
  options.stride = 0;
  EXPECT_THROW(OpenSequence(folder_, options), std::invalid_argument);
}

TEST_F(SequenceTest, Video) {
  if (!WriteVideo("film.avi", 12, 25.0)) GTEST_SKIP() << "OpenCV has no MJPG encoder here";
  WriteText("camera.yaml", "x");
  auto sequence = OpenSequence(folder_ / "film.avi", {});
  EXPECT_TRUE(sequence->is_video());
  EXPECT_EQ(sequence->image_size(), cv::Size(64, 48));
  EXPECT_EQ(sequence->NumFrames(), 12);
  EXPECT_EQ(sequence->camera_reference().value().file, folder_ / "camera.yaml");
  std::vector<Frame> frames = ReadAll(*sequence);
  ASSERT_EQ(frames.size(), 12u);
  EXPECT_EQ(sequence->NumFrames(), 12);
  EXPECT_EQ(sequence->timestamps_s().size(), 12u);
  for (int k = 0; k < 12; ++k) {
    EXPECT_EQ(frames[k].id, FrameId{k});
    EXPECT_NEAR(frames[k].timestamp_s, k / 25.0, 1e-6);
    ASSERT_EQ(frames[k].image.type(), CV_8UC3);
    EXPECT_NEAR(cv::mean(frames[k].image)[0], 20.0 * k, 4.0) << k;
  }

  SequenceOptions options;
  options.first = 3;
  options.last = 9;
  options.stride = 4;
  sequence = OpenSequence(folder_ / "film.avi", options);
  EXPECT_EQ(sequence->NumFrames(), 2);
  frames = ReadAll(*sequence);
  EXPECT_THAT(Names(frames), ElementsAre("000003", "000007"));
  EXPECT_NEAR(frames[1].timestamp_s, 7.0 / 25.0, 1e-6);
  EXPECT_NEAR(cv::mean(frames[1].image)[0], 140.0, 4.0);
  EXPECT_EQ(sequence->NumFrames(), 2);
  EXPECT_FALSE(sequence->Next());

  sequence = OpenSequence(folder_ / "film.avi", options);
  EXPECT_THAT(sequence->Files(), ElementsAre(folder_ / "film.avi"));
  sequence->Skip(1);
  frames = ReadAll(*sequence);
  EXPECT_THAT(Names(frames), ElementsAre("000007"));
  EXPECT_EQ(frames[0].id, FrameId{1});
  EXPECT_NEAR(cv::mean(frames[0].image)[0], 140.0, 4.0);
  EXPECT_THAT(sequence->timestamps_s(), SizeIs(2));

  options.last = std::numeric_limits<int>::max();
  options.stride = std::numeric_limits<int>::max();
  sequence = OpenSequence(folder_ / "film.avi", options);
  EXPECT_EQ(sequence->NumFrames(), 1);
  EXPECT_EQ(ReadAll(*sequence).size(), 1u);

  options = {};
  options.first = 12;
  EXPECT_THAT(Complaint(folder_ / "film.avi", options), HasSubstr("there are only 12"));
}

TEST_F(SequenceTest, RefusesFilesThatAreNoVideo) {
  EXPECT_THAT(Complaint(WriteText("film.mp4", "no film")), HasSubstr("not a video"));
}

TEST(MatchToImages, FillsInScalesOrRefuses) {
  Camera camera;
  camera.fx = camera.fy = 500.0;
  EXPECT_EQ(MatchToImages(camera, {752, 480}).width, 752);
  camera.width = 640;
  camera.height = 480;
  EXPECT_EQ(MatchToImages(camera, {640, 480}), camera);
  camera.cx = 319.5;
  camera.cy = 99.5;
  const Camera half = MatchToImages(camera, {320, 240});
  EXPECT_DOUBLE_EQ(half.fy, 250.0);
  EXPECT_DOUBLE_EQ(half.cx, 159.5);
  EXPECT_DOUBLE_EQ(half.cy, 49.5);
  EXPECT_EQ(half.height, 240);
  EXPECT_EQ(MatchToImages(half, {640, 480}), camera);
  EXPECT_THROW(MatchToImages(camera, {641, 480}), std::runtime_error);
  try {
    MatchToImages(camera, {752, 480});
    FAIL() << "no exception";
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), HasSubstr("camera says 640x480, images are 752x480: give"));
  }
  // A phone filmed upright: players and OpenCV turn such videos.
  try {
    MatchToImages(camera, {480, 640});
    FAIL() << "no exception";
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), HasSubstr("camera held as it was here"));
  }
}

}  // namespace
}  // namespace rotslam
