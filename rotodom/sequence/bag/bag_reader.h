#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace rotslam {

/// One topic of a bag.
struct BagTopic {
  std::string name;      // "/cam0/image_raw"
  std::string type;      // "sensor_msgs/Image", in ROS 2 too (without its "/msg")
  std::string encoding;  // how messages are serialised: "ros1", "cdr", or another word of the bag's
  std::int64_t count = 0;  // messages in the bag
};

/// Says whether the messages of a topic (its count is not known yet) will be read.
using BagFilter = std::function<bool(const BagTopic&)>;

/// The position of one message in the file.
struct BagEntry {
  static constexpr std::size_t kHeadSize = 12;

  std::size_t topic = 0;               // in BagReader::topics()
  std::int64_t time_ns = 0;            // when it was recorded, since 1970
  std::uint64_t size = 0;              // bytes, as they are stored
  std::array<char, kHeadSize> head{};  // the first bytes, zeros where there are fewer
  std::uint64_t checksum = 0;          // of the bytes behind them in a short message; 0: not known
  // For the reader itself: file of a folder, chunk of the file, place in it.
  std::size_t part = 0;
  std::size_t chunk = 0;
  std::uint64_t offset = 0;
};

/// The messages of a recording. One pass at the start finds where they lie, so that an index that
/// is missing or wrong does not matter; memory is bounded by 80 bytes for each message of a wanted
/// topic and two chunks.
class BagReader {
 public:
  virtual ~BagReader() = default;
  BagReader(const BagReader&) = delete;
  BagReader& operator=(const BagReader&) = delete;

  const std::vector<BagTopic>& topics() const { return topics_; }

  /// Messages of the wanted topics in order of time_ns; equal times in the order of the file.
  const std::vector<BagEntry>& entries() const { return entries_; }

  /// The parts that were left out, with the reason, one line each: a truncated file, a bad chunk.
  const std::vector<std::string>& notes() const { return notes_; }

  /// The bytes of a message. Throws std::runtime_error, in one line that names the file, when they
  /// cannot be read.
  std::string Read(const BagEntry& entry);

 protected:
  BagReader(std::filesystem::path path, BagFilter wanted)
      : path_(std::move(path)), wanted_(std::move(wanted)) {}

  [[noreturn]] void Fail(const std::string& reason) const;

  // Number of the topic with this name, type and encoding, which is new or not.
  std::size_t AddTopic(BagTopic topic);

  // First bytes of a message that AddMessage wants, of `size` in all: a short one's are all.
  static std::size_t NumFirstBytes(std::uint64_t size);

  // Counts a message and, where its topic is wanted, keeps the entry; `head` are its first bytes.
  void AddMessage(const BagEntry& entry, std::string_view head);
  bool IsWanted(std::size_t topic) const { return is_wanted_[topic]; }

  // These are reported in notes() when all is read.
  void AddBadChunk(const std::string& reason);
  void AddMessageWithoutTopic() { ++num_without_topic_; }

  // Completes notes() and puts entries() into the order of time. Throws std::runtime_error when the
  // file told no topic.
  void Finish();

  // The bytes of a message as they are stored.
  virtual std::string ReadStored(const BagEntry& entry) = 0;

  std::vector<BagTopic> topics_;
  std::vector<BagEntry> entries_;
  std::vector<std::string> notes_;

 private:
  // The message of an entry that rosbag2 compressed on its own; its beginning when that is enough.
  std::string Decompressed(const BagEntry& entry, std::uint64_t most_bytes);

  std::filesystem::path path_;
  BagFilter wanted_;
  std::vector<bool> is_wanted_;
  std::int64_t num_bad_chunks_ = 0;
  std::int64_t num_bad_messages_ = 0;
  std::int64_t num_without_topic_ = 0;
  std::string first_bad_chunk_;
};

/// Opens a recording: a ROS 1 bag (version 2.0), a ROS 2 SQLite file, an MCAP file, or a folder of
/// such files that belong together: rosbag2's with `metadata.yaml`, or the parts NAME_0.bag,
/// NAME_1.bag, ... that `rosbag record --split` leaves. Files are told apart by their first bytes.
/// Throws std::runtime_error, in one line that names the file.
std::unique_ptr<BagReader> OpenBag(const std::filesystem::path& path, const BagFilter& wanted);

/// Whether `path` has the name of a recording (.bag, .db3, .mcap) or is a folder of recordings and
/// no images. Never throws.
bool IsBagName(const std::filesystem::path& path);

/// `text` with `?` in place of line breaks and other control characters, which only damage brings
/// into names.
std::string PrintableText(std::string text);

/// Readers of one kind of file each, for OpenBag.
std::unique_ptr<BagReader> OpenRos1Bag(const std::filesystem::path& file, const BagFilter& wanted);
std::unique_ptr<BagReader> OpenMcapBag(const std::filesystem::path& file, const BagFilter& wanted);
std::unique_ptr<BagReader> OpenSqliteBag(const std::filesystem::path& file,
                                         const BagFilter& wanted);

}  // namespace rotslam
