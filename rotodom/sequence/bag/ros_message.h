#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "rotodom/camera/ros_camera_info.h"
#include "rotodom/sequence/bag/bag_reader.h"
#include "rotodom/sequence/image_file.h"

namespace rotslam {

/// Reads the fields of a ROS message one after another: ROS 1's serialisation (packed, little
/// endian) or CDR (XCDR version 1 of either byte order, each number aligned to its size as counted
/// from behind the four bytes of the encapsulation header). Reading beyond the end gives zeros and
/// makes Failed() true from then on; nothing is allocated for more than there is.
class RosMessageReader {
 public:
  /// @param encoding  "ros1" or "cdr".
  /// Throws std::runtime_error, without a path: another encoding or encapsulation.
  RosMessageReader(std::string_view bytes, const std::string& encoding);

  bool Failed() const { return failed_; }

  std::uint8_t ReadByte() { return static_cast<std::uint8_t>(ReadNumber(1)); }
  std::uint32_t ReadUint32() { return static_cast<std::uint32_t>(ReadNumber(4)); }
  double ReadDouble();

  /// A text, without the zero that CDR puts behind it.
  std::string_view ReadString();

  /// A sequence of bytes, which stay where they are.
  std::string_view ReadByteSequence() { return Take(ReadUint32()); }

  /// A sequence of numbers.
  std::vector<double> ReadDoubleSequence();

  /// The fields of std_msgs/Header: its stamp, in nanoseconds.
  std::int64_t ReadHeader();

 private:
  std::uint64_t ReadNumber(std::size_t size);
  std::string_view Take(std::size_t size);

  std::string_view bytes_;  // without the encapsulation header
  std::size_t position_ = 0;
  bool is_cdr_ = false;
  bool is_big_endian_ = false;
  bool failed_ = false;
};

inline constexpr const char* kRosImageType = "sensor_msgs/Image";
inline constexpr const char* kRosCompressedImageType = "sensor_msgs/CompressedImage";
inline constexpr const char* kRosCameraInfoType = "sensor_msgs/CameraInfo";

/// The stamp in the header of a message, from its first bytes; nanoseconds.
std::int64_t StampOf(const BagTopic& topic, const BagEntry& entry);

/// A sensor_msgs/Image without its pixels, or a sensor_msgs/CompressedImage.
struct RosImageFields {
  std::uint32_t height = 0;  // 0 for a compressed image
  std::uint32_t width = 0;
  std::string encoding;  // "bgr8"; the field `format` of a compressed image
  bool is_big_endian = false;
  std::uint32_t step = 0;  // bytes from row to row
  std::string_view data;   // in the message
};

/// Throws std::runtime_error, without a path, when the message is malformed.
RosImageFields ParseRosImage(const BagTopic& topic, std::string_view message);

/// Why images with these fields are not read, in one line: depth, or an encoding that is not known;
/// empty when they are.
std::string WhyNoPicture(const BagTopic& topic, const RosImageFields& fields);

/// The picture of a message, of its depth and with blue, green and red in this order; an empty one
/// and why where it is malformed. Never throws.
DecodedImage DecodeRosImage(const BagTopic& topic, std::string_view message);

/// Throws std::runtime_error, without a path, when the message is malformed.
RosCameraInfo ParseRosCameraInfo(const BagTopic& topic, std::string_view message);

}  // namespace rotslam
