// Pictures of sensor_msgs/Image and sensor_msgs/CompressedImage.

#include <algorithm>
#include <array>
#include <cctype>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "rotodom/sequence/bag/ros_message.h"

namespace rotslam {
namespace {

// How pixels of an encoding lie in memory, and OpenCV's conversion to grey or blue, green, red.
struct RosEncoding {
  std::string_view name;
  int type = CV_8UC1;
  int conversion = -1;  // -1: none
};

// OpenCV names Bayer patterns by the second and third pixel of the second row, ROS by the first
// pixels of the first and the second.
constexpr std::array<RosEncoding, 27> kRosEncodings = {{
    {"mono8", CV_8UC1},
    {"8UC1", CV_8UC1},
    {"mono16", CV_16UC1},
    {"16UC1", CV_16UC1},
    {"bgr8", CV_8UC3},
    {"8UC3", CV_8UC3},
    {"rgb8", CV_8UC3, cv::COLOR_RGB2BGR},
    {"bgra8", CV_8UC4, cv::COLOR_BGRA2BGR},
    {"8UC4", CV_8UC4, cv::COLOR_BGRA2BGR},
    {"rgba8", CV_8UC4, cv::COLOR_RGBA2BGR},
    {"bgr16", CV_16UC3},
    {"rgb16", CV_16UC3, cv::COLOR_RGB2BGR},
    {"bgra16", CV_16UC4, cv::COLOR_BGRA2BGR},
    {"rgba16", CV_16UC4, cv::COLOR_RGBA2BGR},
    {"bayer_rggb8", CV_8UC1, cv::COLOR_BayerBG2BGR},
    {"bayer_bggr8", CV_8UC1, cv::COLOR_BayerRG2BGR},
    {"bayer_gbrg8", CV_8UC1, cv::COLOR_BayerGR2BGR},
    {"bayer_grbg8", CV_8UC1, cv::COLOR_BayerGB2BGR},
    {"bayer_rggb16", CV_16UC1, cv::COLOR_BayerBG2BGR},
    {"bayer_bggr16", CV_16UC1, cv::COLOR_BayerRG2BGR},
    {"bayer_gbrg16", CV_16UC1, cv::COLOR_BayerGR2BGR},
    {"bayer_grbg16", CV_16UC1, cv::COLOR_BayerGB2BGR},
    {"yuv422", CV_8UC2, cv::COLOR_YUV2BGR_UYVY},
    {"uyvy", CV_8UC2, cv::COLOR_YUV2BGR_UYVY},
    {"yuv422_yuy2", CV_8UC2, cv::COLOR_YUV2BGR_YUY2},
    {"yuyv", CV_8UC2, cv::COLOR_YUV2BGR_YUY2},
    {"yuy2", CV_8UC2, cv::COLOR_YUV2BGR_YUY2},
}};

const RosEncoding* FindRosEncoding(std::string_view name) {
  const auto found =
      std::find_if(kRosEncodings.begin(), kRosEncodings.end(), [&](const RosEncoding& encoding) {
        return encoding.name == name;
      });
  return found == kRosEncodings.end() ? nullptr : &*found;
}

// `pixels` as OpenCV's conversion has them. Throws cv::Exception (YUV of an odd width).
cv::Mat Converted(const cv::Mat& pixels, int conversion) {
  cv::Mat image;
  if (conversion < 0) return pixels.clone();
  cv::cvtColor(pixels, image, conversion);
  return image;
}

DecodedImage DecodePlain(const RosImageFields& fields) {
  constexpr std::uint32_t kMostPixels = 1 << 16;  // of a side
  const RosEncoding& encoding = *FindRosEncoding(fields.encoding);
  if (fields.width == 0 || fields.height == 0) return {{}, "image is of 0 pixels"};
  if (fields.width > kMostPixels || fields.height > kMostPixels) {
    return {{}, "image claims more pixels than any camera has"};
  }
  const std::uint64_t row_size = std::uint64_t{fields.width} * CV_ELEM_SIZE(encoding.type);
  const std::uint64_t step = fields.step == 0 ? row_size : fields.step;
  if (step < row_size || step * (fields.height - 1) + row_size > fields.data.size()) {
    return {{},
            "image claims " + std::to_string(fields.width) + "x" + std::to_string(fields.height) +
                " pixels of " + fields.encoding + ", more than its " +
                std::to_string(fields.data.size()) + " bytes are"};
  }
  // Copied row by row: OpenCV wants steps that pixels divide.
  cv::Mat pixels(static_cast<int>(fields.height), static_cast<int>(fields.width), encoding.type);
  for (int row = 0; row < pixels.rows; ++row) {
    const char* begin = fields.data.data() + step * static_cast<std::uint64_t>(row);
    std::copy_n(begin, row_size, pixels.ptr<char>(row));
    if (fields.is_big_endian && pixels.depth() == CV_16U) {
      char* bytes = pixels.ptr<char>(row);
      for (std::uint64_t k = 0; k + 1 < row_size; k += 2) std::swap(bytes[k], bytes[k + 1]);
    }
  }
  return {Converted(pixels, encoding.conversion), {}};
}

// The pixels' encoding before they were compressed: "rgb8" of "rgb8; jpeg compressed bgr8".
std::string_view EncodingBefore(std::string_view format) {
  const std::size_t end = format.find(';');
  return end == std::string_view::npos ? std::string_view() : format.substr(0, end);
}

DecodedImage DecodeCompressed(const RosImageFields& fields) {
  DecodedImage decoded = DecodeImageBytes({fields.data.begin(), fields.data.end()});
  if (decoded.image.empty()) return decoded;
  // The transport compresses colours in the order blue, green, red, unless it says otherwise.
  if (decoded.image.channels() == 3 &&
      fields.encoding.find("compressed rgb") != std::string::npos) {
    cv::cvtColor(decoded.image, decoded.image, cv::COLOR_RGB2BGR);
  }
  // A Bayer pattern that was compressed as it was.
  const RosEncoding* before = FindRosEncoding(EncodingBefore(fields.encoding));
  if (decoded.image.channels() == 1 && before != nullptr && before->name.starts_with("bayer_")) {
    decoded.image = Converted(decoded.image, before->conversion);
  }
  return decoded;
}

bool IsDepthName(std::string_view topic) {
  std::string name(topic);
  std::transform(name.begin(), name.end(), name.begin(), [](unsigned char c) {
    return static_cast<char>(std::tolower(c));
  });
  return name.find("depth") != std::string::npos || name.find("disparity") != std::string::npos;
}

}  // namespace

RosImageFields ParseRosImage(const BagTopic& topic, std::string_view message) {
  RosMessageReader reader(message, topic.encoding);
  RosImageFields fields;
  reader.ReadHeader();
  if (topic.type == kRosCompressedImageType) {
    fields.encoding = reader.ReadString();
  } else {
    fields.height = reader.ReadUint32();
    fields.width = reader.ReadUint32();
    fields.encoding = reader.ReadString();
    fields.is_big_endian = reader.ReadByte() != 0;
    fields.step = reader.ReadUint32();
  }
  fields.data = reader.ReadByteSequence();
  if (reader.Failed()) throw std::runtime_error("message is cut off or damaged");
  fields.encoding = PrintableText(std::move(fields.encoding));
  return fields;
}

std::string WhyNoPicture(const BagTopic& topic, const RosImageFields& fields) {
  const std::string& encoding = fields.encoding;
  const std::string quoted = "'" + encoding.substr(0, 60) + "'";
  if (topic.type == kRosCompressedImageType) {
    if (encoding.find("compressedDepth") != std::string::npos) {
      return "is depth (format " + quoted + "), not pictures";
    }
    return {};
  }
  const bool is_16_bit = encoding == "16UC1" || encoding == "mono16";
  if (encoding == "32FC1" || encoding == "64FC1" || (is_16_bit && IsDepthName(topic.name))) {
    return "is depth (encoding " + quoted + "), not pictures";
  }
  if (FindRosEncoding(encoding) != nullptr) return {};
  return "has encoding " + quoted +
         ", which is not read; mono8, mono16, rgb8, bgr8, rgba8, bgra8, bayer_*, uyvy and yuyv are";
}

DecodedImage DecodeRosImage(const BagTopic& topic, std::string_view message) {
  try {
    const RosImageFields fields = ParseRosImage(topic, message);
    if (std::string why = WhyNoPicture(topic, fields); !why.empty()) return {{}, "image " + why};
    return topic.type == kRosCompressedImageType ? DecodeCompressed(fields) : DecodePlain(fields);
  } catch (const cv::Exception&) {
    return {{}, "pixels cannot be converted (YUV of an odd width, or out of memory)"};
  } catch (const std::runtime_error& error) {
    return {{}, error.what()};
  }
}

}  // namespace rotslam
