#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "rotodom/camera/ros_camera_info.h"

namespace rotslam {

/// How ROS writes the fields of a message.
enum class Serialisation { kRos1, kCdrLittle, kCdrBig };

/// The fields of sensor_msgs/Image.
struct TestRosImage {
  std::int64_t stamp_ns = 0;
  std::uint32_t height = 0;
  std::uint32_t width = 0;
  std::string encoding;
  bool is_big_endian = false;
  std::uint32_t step = 0;
  std::string data;
};

std::string RosImageMessage(Serialisation how, const TestRosImage& image);
std::string RosCompressedImageMessage(Serialisation how,
                                      std::int64_t stamp_ns,
                                      const std::string& format,
                                      const std::string& data);
std::string RosCameraInfoMessage(Serialisation how, const RosCameraInfo& info);

struct TestTopic {
  std::string name;
  std::string type = "sensor_msgs/Image";
  std::string encoding;  // of MCAP and SQLite; empty: "cdr"
};

struct TestMessage {
  std::size_t topic = 0;
  std::int64_t time_ns = 0;
  std::string bytes;
};

struct TestBag {
  std::vector<TestTopic> topics;
  std::vector<TestMessage> messages;
};

struct BagWriterOptions {
  std::string compression = "none";    // of chunks: none, bz2, lz4, zstd
  std::size_t messages_per_chunk = 2;  // 0: MCAP without chunks
  bool has_index = true;               // what follows the messages
};

/// The bytes of a ROS 1 bag of version 2.0 and of an MCAP file.
std::string Ros1BagBytes(const TestBag& bag, const BagWriterOptions& options = {});
std::string McapBytes(const TestBag& bag, const BagWriterOptions& options = {});

/// Writes the SQLite file that rosbag2 writes.
void WriteSqliteBag(const std::filesystem::path& file, const TestBag& bag);

/// Whether this test program can compress so.
bool CanCompress(const std::string& compression);
std::string Compressed(const std::string& compression, const std::string& bytes);

}  // namespace rotslam
