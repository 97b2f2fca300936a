#include "rotodom/sequence/bag/ros_message.h"

#include <cstring>
#include <stdexcept>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "tests/rotodom/sequence/bag/bag_writer.h"

namespace rotslam {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

constexpr Serialisation kAll[] = {
    Serialisation::kRos1, Serialisation::kCdrLittle, Serialisation::kCdrBig};

BagTopic ImageTopic(Serialisation how, const std::string& type = kRosImageType) {
  return {"/cam0/image_raw", type, how == Serialisation::kRos1 ? "ros1" : "cdr", 1};
}

// 2 x 2 pixels, each row followed by one byte of padding.
TestRosImage Image(const std::string& encoding, const std::string& row0, const std::string& row1) {
  TestRosImage image;
  image.stamp_ns = 1'700'000'000'123'456'789;
  image.height = 2;
  image.width = 2;
  image.encoding = encoding;
  image.step = static_cast<std::uint32_t>(row0.size()) + 1;
  image.data = row0 + "P" + row1 + "P";
  return image;
}

cv::Mat Decoded(const TestRosImage& image, Serialisation how = Serialisation::kRos1) {
  const DecodedImage decoded = DecodeRosImage(ImageTopic(how), RosImageMessage(how, image));
  EXPECT_EQ(decoded.problem, "");
  return ToEightBits(decoded.image, PixelScale()).image;
}

std::vector<int> Values(const cv::Mat& image) {
  const cv::Mat row = image.clone().reshape(1, 1);
  return std::vector<int>(row.begin<std::uint8_t>(), row.end<std::uint8_t>());
}

TEST(RosMessage, ReadsStampsOfEverySerialisation) {
  for (const Serialisation how : kAll) {
    const std::string message = RosImageMessage(how, Image("mono8", "ab", "cd"));
    BagEntry entry;
    std::memcpy(entry.head.data(), message.data(), entry.head.size());
    EXPECT_EQ(StampOf(ImageTopic(how), entry), 1'700'000'000'123'456'789);
  }
}

TEST(RosMessage, ReadsCameraInfoOfEverySerialisation) {
  RosCameraInfo info;
  info.width = 640;
  info.height = 480;
  info.K = {400.5, 0, 320.25, 0, 401.5, 240.75, 0, 0, 1};
  info.P = {390, 0, 310, -1, 0, 391, 230, 0, 0, 0, 1, 0};
  info.binning_x = 2;
  info.binning_y = 3;
  info.roi_x = 4;
  info.roi_y = 5;
  info.roi_height = 6;
  info.roi_width = 7;
  // Texts of every length, so that what follows is aligned in every way.
  for (const char* model : {"", "fov", "plumb", "plumb_bob", "equidistant"}) {
    for (const std::size_t count : {0, 4, 5, 8}) {
      info.distortion_model = model;
      info.D.assign(count, 0.125);
      for (const Serialisation how : kAll) {
        const RosCameraInfo read = ParseRosCameraInfo(ImageTopic(how, kRosCameraInfoType),
                                                      RosCameraInfoMessage(how, info));
        EXPECT_EQ(read.width, 640);
        EXPECT_EQ(read.height, 480);
        EXPECT_EQ(read.distortion_model, model);
        EXPECT_EQ(read.D, info.D);
        EXPECT_EQ(read.K, info.K);
        EXPECT_EQ(read.P, info.P);
        EXPECT_EQ(read.binning_x, 2);
        EXPECT_EQ(read.binning_y, 3);
        EXPECT_EQ(read.roi_x, 4);
        EXPECT_EQ(read.roi_y, 5);
        EXPECT_EQ(read.roi_height, 6);
        EXPECT_EQ(read.roi_width, 7);
      }
    }
  }
}

TEST(RosMessage, RefusesOtherSerialisationsByName) {
  const std::string message =
      RosImageMessage(Serialisation::kCdrLittle, Image("mono8", "ab", "cd"));
  BagTopic topic = ImageTopic(Serialisation::kCdrLittle);
  topic.encoding = "protobuf";
  EXPECT_THAT(DecodeRosImage(topic, message).problem, HasSubstr("'protobuf'"));
  std::string list = message;
  list[1] = 3;
  EXPECT_THAT(DecodeRosImage(ImageTopic(Serialisation::kCdrLittle), list).problem,
              HasSubstr("encapsulation 3"));
}

TEST(RosImage, DecodesGreyAndColours) {
  for (const Serialisation how : kAll) {
    EXPECT_THAT(Values(Decoded(Image("mono8", "\x01\x02", "\x03\x04"), how)),
                ElementsAre(1, 2, 3, 4));
    EXPECT_THAT(Values(Decoded(Image("8UC1", "\x01\x02", "\x03\x04"), how)),
                ElementsAre(1, 2, 3, 4));
    EXPECT_THAT(Values(Decoded(Image("bgr8", "\1\2\3\4\5\6", "\7\10\11\12\13\14"), how)),
                ElementsAre(1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12));
    EXPECT_THAT(Values(Decoded(Image("rgb8", "\1\2\3\4\5\6", "\7\10\11\12\13\14"), how)),
                ElementsAre(3, 2, 1, 6, 5, 4, 9, 8, 7, 12, 11, 10));
    EXPECT_THAT(Values(Decoded(Image("bgra8", "\1\2\3A\4\5\6A", "\7\10\11A\12\13\14A"), how)),
                ElementsAre(1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12));
    EXPECT_THAT(Values(Decoded(Image("rgba8", "\1\2\3A\4\5\6A", "\7\10\11A\12\13\14A"), how)),
                ElementsAre(3, 2, 1, 6, 5, 4, 9, 8, 7, 12, 11, 10));
  }
}

TEST(RosImage, DecodesSixteenBitsOfBothByteOrders) {
  // 0xffff, 0x8080 and 0x0000 of 65535 are 255, 128 and 0 of 255.
  const std::string row0("\xff\xff\x80\x80", 4);
  const std::string row1("\x00\x00\xff\xff", 4);
  EXPECT_THAT(Values(Decoded(Image("mono16", row0, row1))), ElementsAre(255, 128, 0, 255));
  // 0x0100 is 1, 0x00ff rounds to 1, 0xff00 is 254.
  TestRosImage image = Image("mono16", std::string("\x01\x00\xff\x00", 4), row1);
  image.is_big_endian = true;
  EXPECT_THAT(Values(Decoded(image)), ElementsAre(1, 254, 0, 255));
}

// The corner of a picture of one colour is that colour, whatever pattern saw it.
TEST(RosImage, DecodesEveryBayerPattern) {
  const auto letter_value = [](char letter) {
    return letter == 'r' ? '\xc8' : letter == 'g' ? '\x64' : '\x14';
  };
  for (const std::string pattern : {"rggb", "bggr", "gbrg", "grbg"}) {
    TestRosImage image;
    image.encoding = "bayer_" + pattern + "8";
    image.height = image.width = image.step = 8;
    for (int row = 0; row < 8; ++row) {
      for (int column = 0; column < 8; ++column) {
        image.data += letter_value(pattern[static_cast<std::size_t>(row % 2 * 2 + column % 2)]);
      }
    }
    const cv::Mat decoded = Decoded(image);
    ASSERT_EQ(decoded.type(), CV_8UC3);
    EXPECT_EQ(decoded.at<cv::Vec3b>(4, 4), cv::Vec3b(20, 100, 200)) << pattern;
    EXPECT_EQ(decoded.at<cv::Vec3b>(3, 4), cv::Vec3b(20, 100, 200)) << pattern;
  }
}

TEST(RosImage, DecodesYuv) {
  // Grey: the colours are 128, and 16 and 235 are black and white.
  const std::vector<int> grey = {0, 0, 0, 255, 255, 255, 255, 255, 255, 0, 0, 0};
  for (const char* encoding : {"yuv422", "uyvy"}) {
    EXPECT_EQ(Values(Decoded(Image(encoding, "\x80\x10\x80\xeb", "\x80\xeb\x80\x10"))), grey);
  }
  for (const char* encoding : {"yuv422_yuy2", "yuyv"}) {
    EXPECT_EQ(Values(Decoded(Image(encoding, "\x10\x80\xeb\x80", "\xeb\x80\x10\x80"))), grey);
  }
}

TEST(RosImage, DecodesCompressedImages) {
  const cv::Mat image(8, 8, CV_8UC3, cv::Scalar(10, 100, 200));
  std::vector<unsigned char> png;
  cv::imencode(".png", image, png);
  const std::string bytes(png.begin(), png.end());
  for (const Serialisation how : kAll) {
    const BagTopic topic = ImageTopic(how, kRosCompressedImageType);
    const auto decode = [&](const std::string& format) {
      return DecodeRosImage(topic, RosCompressedImageMessage(how, 1, format, bytes));
    };
    EXPECT_EQ(decode("png").image.at<cv::Vec3b>(3, 3), cv::Vec3b(10, 100, 200));
    EXPECT_EQ(decode("rgb8; png compressed bgr8").image.at<cv::Vec3b>(3, 3),
              cv::Vec3b(10, 100, 200));
    EXPECT_EQ(decode("rgb8; png compressed rgb8").image.at<cv::Vec3b>(3, 3),
              cv::Vec3b(200, 100, 10));
    EXPECT_THAT(decode("16UC1; compressedDepth").problem, HasSubstr("depth"));
  }
}

TEST(RosImage, RefusesDepthAndOtherEncodingsByName) {
  const auto problem = [](const std::string& topic, const std::string& encoding) {
    RosImageFields fields;
    fields.encoding = encoding;
    return WhyNoPicture({topic, kRosImageType, "cdr", 1}, fields);
  };
  EXPECT_THAT(problem("/image", "32FC1"), HasSubstr("depth (encoding '32FC1')"));
  EXPECT_THAT(problem("/camera/depth/image", "16UC1"), HasSubstr("depth (encoding '16UC1')"));
  EXPECT_EQ(problem("/thermal/image", "16UC1"), "");
  EXPECT_THAT(problem("/image", "nv21"), HasSubstr("'nv21', which is not read"));
}

TEST(RosImage, NoticesMessagesThatAreShort) {
  TestRosImage image = Image("mono8", "ab", "cd");
  image.height = 3;
  const auto problem = [](const TestRosImage& damaged, std::size_t cut = 0) {
    std::string message = RosImageMessage(Serialisation::kRos1, damaged);
    message.resize(message.size() - cut);
    return DecodeRosImage(ImageTopic(Serialisation::kRos1), message).problem;
  };
  EXPECT_THAT(problem(image), HasSubstr("2x3 pixels of mono8, more than its 6 bytes"));
  image.height = 2;
  EXPECT_THAT(problem(image, 1), HasSubstr("cut off"));
  image.width = 0xffffffff;
  EXPECT_THAT(problem(image), HasSubstr("more pixels"));
  image.width = 0;
  EXPECT_THAT(problem(image), HasSubstr("0 pixels"));
}

}  // namespace
}  // namespace rotslam
