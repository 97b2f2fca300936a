#include "rotodom/sequence/bag/ros_message.h"

#include <algorithm>
#include <bit>
#include <stdexcept>
#include <utility>

namespace rotslam {

RosMessageReader::RosMessageReader(std::string_view bytes, const std::string& encoding)
    : bytes_(bytes), is_cdr_(encoding == "cdr") {
  if (!is_cdr_ && encoding != "ros1") {
    throw std::runtime_error("messages are serialised as '" + encoding +
                             "'; ROS 1's serialisation and CDR are read");
  }
  if (!is_cdr_) return;
  // Two bytes of kind, two of options.
  if (bytes.size() < 4) {
    failed_ = true;
    return;
  }
  const auto kind = static_cast<unsigned>(static_cast<unsigned char>(bytes[0])) << 8 |
                    static_cast<unsigned char>(bytes[1]);
  if (kind > 1) {
    throw std::runtime_error("a message has CDR encapsulation " + std::to_string(kind) +
                             "; 0 and 1 (plain XCDR version 1) are read");
  }
  is_big_endian_ = kind == 0;
  bytes_.remove_prefix(4);
}

std::string_view RosMessageReader::Take(std::size_t size) {
  if (failed_ || size > bytes_.size() - position_) {
    failed_ = true;
    return {};
  }
  position_ += size;
  return bytes_.substr(position_ - size, size);
}

std::uint64_t RosMessageReader::ReadNumber(std::size_t size) {
  if (is_cdr_) Take((size - position_ % size) % size);
  const std::string_view taken = Take(size);
  std::uint64_t number = 0;
  for (std::size_t k = 0; k < taken.size(); ++k) {
    const std::size_t at = is_big_endian_ ? k : taken.size() - 1 - k;
    number = number << 8 | static_cast<unsigned char>(taken[at]);
  }
  return number;
}

double RosMessageReader::ReadDouble() { return std::bit_cast<double>(ReadNumber(8)); }

std::string_view RosMessageReader::ReadString() {
  std::string_view text = Take(ReadUint32());
  if (is_cdr_ && !text.empty() && text.back() == '\0') text.remove_suffix(1);
  return text;
}

std::vector<double> RosMessageReader::ReadDoubleSequence() {
  const std::uint32_t count = ReadUint32();
  std::vector<double> numbers;
  for (std::uint32_t k = 0; k < count && !failed_; ++k) numbers.push_back(ReadDouble());
  return numbers;
}

std::int64_t RosMessageReader::ReadHeader() {
  if (!is_cdr_) ReadUint32();  // ROS 1's sequence number
  const std::uint32_t seconds = ReadUint32();
  const std::uint32_t nanoseconds = ReadUint32();
  ReadString();  // frame_id
  return std::int64_t{seconds} * 1'000'000'000 + nanoseconds;
}

std::int64_t StampOf(const BagTopic& topic, const BagEntry& entry) {
  // The head reaches behind the stamp, but not to the name of the frame: that one fails unnoticed.
  try {
    RosMessageReader reader({entry.head.data(), entry.head.size()}, topic.encoding);
    return reader.ReadHeader();
  } catch (const std::runtime_error&) {
    return 0;  // the message itself will say what is wrong with it
  }
}

RosCameraInfo ParseRosCameraInfo(const BagTopic& topic, std::string_view message) {
  RosMessageReader reader(message, topic.encoding);
  reader.ReadHeader();
  const auto read_int = [&] { return static_cast<int>(reader.ReadUint32() & 0x7fffffff); };
  RosCameraInfo info;
  info.height = read_int();
  info.width = read_int();
  info.distortion_model = reader.ReadString();
  info.D = reader.ReadDoubleSequence();
  for (double& number : info.K) number = reader.ReadDouble();
  for (int k = 0; k < 9; ++k) reader.ReadDouble();  // R, which turns between two rectified images
  for (double& number : info.P) number = reader.ReadDouble();
  info.binning_x = read_int();
  info.binning_y = read_int();
  info.roi_x = read_int();
  info.roi_y = read_int();
  info.roi_height = read_int();
  info.roi_width = read_int();
  if (reader.Failed()) throw std::runtime_error("message is cut off or damaged");
  info.distortion_model = PrintableText(std::move(info.distortion_model));
  return info;
}

}  // namespace rotslam
