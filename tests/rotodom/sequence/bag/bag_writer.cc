#include "tests/rotodom/sequence/bag/bag_writer.h"

#include <algorithm>
#include <bit>
#include <stdexcept>

#include <sqlite3.h>

#ifdef ROTSLAM_HAVE_BZIP2
#include <bzlib.h>
#endif
#ifdef ROTSLAM_HAVE_LZ4
#include <lz4frame.h>
#endif
#ifdef ROTSLAM_HAVE_ZSTD
#include <zstd.h>
#endif

namespace rotslam {
namespace {

std::string Number(std::uint64_t value, std::size_t size, bool is_big_endian = false) {
  std::string bytes(size, '\0');
  for (std::size_t k = 0; k < size; ++k) {
    const std::size_t at = is_big_endian ? size - 1 - k : k;
    bytes[at] = static_cast<char>(value >> (8 * k) & 0xff);
  }
  return bytes;
}

// Fields of a message one after another.
class MessageWriter {
 public:
  explicit MessageWriter(Serialisation how) : how_(how) {}

  void Put(std::uint64_t value, std::size_t size) {
    if (how_ != Serialisation::kRos1) {
      while (bytes_.size() % size != 0) bytes_ += '\0';
    }
    bytes_ += Number(value, size, how_ == Serialisation::kCdrBig);
  }
  void PutDouble(double value) { Put(std::bit_cast<std::uint64_t>(value), 8); }
  void PutBytes(const std::string& bytes) {
    Put(bytes.size(), 4);
    bytes_ += bytes;
  }
  void PutString(const std::string& text) {
    PutBytes(how_ == Serialisation::kRos1 ? text : text + std::string(1, '\0'));
  }
  void PutHeader(std::int64_t stamp_ns) {
    if (how_ == Serialisation::kRos1) Put(7, 4);
    Put(static_cast<std::uint64_t>(stamp_ns / 1'000'000'000), 4);
    Put(static_cast<std::uint64_t>(stamp_ns % 1'000'000'000), 4);
    PutString("camera");
  }

  std::string Finish() const {
    if (how_ == Serialisation::kRos1) return bytes_;
    return std::string("\0", 1) + (how_ == Serialisation::kCdrBig ? '\0' : '\1') +
           std::string(2, '\0') + bytes_;
  }

 private:
  Serialisation how_;
  std::string bytes_;
};

std::string Counted(const std::string& bytes) { return Number(bytes.size(), 4) + bytes; }

// ---- ROS 1

std::string Ros1Field(const std::string& name, const std::string& value) {
  return Counted(name + "=" + value);
}

std::string Ros1Record(int op, const std::string& fields, const std::string& data) {
  return Counted(fields + Ros1Field("op", Number(static_cast<std::uint64_t>(op), 1))) +
         Counted(data);
}

std::string Ros1Time(std::int64_t time_ns) {
  return Number(static_cast<std::uint64_t>(time_ns / 1'000'000'000), 4) +
         Number(static_cast<std::uint64_t>(time_ns % 1'000'000'000), 4);
}

std::string Ros1Connection(std::size_t number, const TestTopic& topic) {
  return Ros1Record(7,
                    Ros1Field("conn", Number(number, 4)) + Ros1Field("topic", topic.name),
                    Ros1Field("topic", topic.name) + Ros1Field("type", topic.type) +
                        Ros1Field("md5sum", "*") + Ros1Field("message_definition", "..."));
}

// ---- MCAP

std::string McapRecord(int op, const std::string& content) {
  return Number(static_cast<std::uint64_t>(op), 1) + Number(content.size(), 8) + content;
}

}  // namespace

std::string RosImageMessage(Serialisation how, const TestRosImage& image) {
  MessageWriter writer(how);
  writer.PutHeader(image.stamp_ns);
  writer.Put(image.height, 4);
  writer.Put(image.width, 4);
  writer.PutString(image.encoding);
  writer.Put(image.is_big_endian ? 1 : 0, 1);
  writer.Put(image.step, 4);
  writer.PutBytes(image.data);
  return writer.Finish();
}

std::string RosCompressedImageMessage(Serialisation how,
                                      std::int64_t stamp_ns,
                                      const std::string& format,
                                      const std::string& data) {
  MessageWriter writer(how);
  writer.PutHeader(stamp_ns);
  writer.PutString(format);
  writer.PutBytes(data);
  return writer.Finish();
}

std::string RosCameraInfoMessage(Serialisation how, const RosCameraInfo& info) {
  MessageWriter writer(how);
  const auto put = [&](int value) { writer.Put(static_cast<std::uint64_t>(value), 4); };
  writer.PutHeader(5);
  put(info.height);
  put(info.width);
  writer.PutString(info.distortion_model);
  writer.Put(info.D.size(), 4);
  for (const double value : info.D) writer.PutDouble(value);
  for (const double value : info.K) writer.PutDouble(value);
  for (int k = 0; k < 9; ++k) writer.PutDouble(k % 4 == 0 ? 1.0 : 0.0);
  for (const double value : info.P) writer.PutDouble(value);
  put(info.binning_x);
  put(info.binning_y);
  put(info.roi_x);
  put(info.roi_y);
  put(info.roi_height);
  put(info.roi_width);
  writer.Put(0, 1);
  return writer.Finish();
}

std::string Ros1BagBytes(const TestBag& bag, const BagWriterOptions& options) {
  std::string records;
  std::string infos;
  const std::size_t count = std::max<std::size_t>(options.messages_per_chunk, 1);
  constexpr std::size_t kBegin = 13 + 4096;
  for (std::size_t begin = 0; begin < bag.messages.size(); begin += count) {
    const std::size_t end = std::min(begin + count, bag.messages.size());
    std::string chunk;
    std::string index;
    for (std::size_t k = begin; k < end; ++k) {
      const TestMessage& message = bag.messages[k];
      const std::string connection = Ros1Field("conn", Number(message.topic, 4));
      chunk += Ros1Connection(message.topic, bag.topics[message.topic]);
      index +=
          Ros1Record(4,
                     Ros1Field("ver", Number(1, 4)) + connection + Ros1Field("count", Number(1, 4)),
                     Ros1Time(message.time_ns) + Number(chunk.size(), 4));
      chunk +=
          Ros1Record(2, connection + Ros1Field("time", Ros1Time(message.time_ns)), message.bytes);
    }
    infos += Ros1Record(6,
                        Ros1Field("ver", Number(1, 4)) +
                            Ros1Field("chunk_pos", Number(kBegin + records.size(), 8)) +
                            Ros1Field("start_time", Ros1Time(bag.messages[begin].time_ns)) +
                            Ros1Field("end_time", Ros1Time(bag.messages[end - 1].time_ns)) +
                            Ros1Field("count", Number(1, 4)),
                        Number(bag.messages[begin].topic, 4) + Number(end - begin, 4));
    records += Ros1Record(
        5,
        Ros1Field("compression", options.compression) + Ros1Field("size", Number(chunk.size(), 4)),
        Compressed(options.compression, chunk));
    if (options.has_index) records += index;
  }
  const std::size_t index_begin = options.has_index ? kBegin + records.size() : 0;
  std::string header = Counted(Ros1Field("index_pos", Number(index_begin, 8)) +
                               Ros1Field("conn_count", Number(bag.topics.size(), 4)) +
                               Ros1Field("chunk_count", Number(bag.messages.size(), 4)) +
                               Ros1Field("op", Number(3, 1)));
  header += Counted(std::string(4096 - header.size() - 4, ' '));
  std::string bytes = "#ROSBAG V2.0\n" + header + records;
  if (!options.has_index) return bytes;
  for (std::size_t k = 0; k < bag.topics.size(); ++k) bytes += Ros1Connection(k, bag.topics[k]);
  return bytes + infos;
}

std::string McapBytes(const TestBag& bag, const BagWriterOptions& options) {
  const std::string magic = "\x89MCAP0\r\n";
  std::string bytes = magic + McapRecord(1, Counted("ros2") + Counted("rotslam tests"));
  std::string channels;
  for (std::size_t k = 0; k < bag.topics.size(); ++k) {
    const TestTopic& topic = bag.topics[k];
    std::string type = topic.type;
    type.insert(type.find('/'), "/msg");
    channels +=
        McapRecord(3, Number(k + 1, 2) + Counted(type) + Counted("ros2msg") + Counted("..."));
    channels +=
        McapRecord(4,
                   Number(k, 2) + Number(k + 1, 2) + Counted(topic.name) +
                       Counted(topic.encoding.empty() ? "cdr" : topic.encoding) + Number(0, 4));
  }
  const auto record_of = [](const TestMessage& message) {
    const auto time = static_cast<std::uint64_t>(message.time_ns);
    return McapRecord(5,
                      Number(message.topic, 2) + Number(0, 4) + Number(time, 8) + Number(time, 8) +
                          message.bytes);
  };
  if (options.messages_per_chunk == 0) {
    bytes += channels;
    for (const TestMessage& message : bag.messages) bytes += record_of(message);
  } else {
    const std::size_t count = options.messages_per_chunk;
    for (std::size_t begin = 0; begin < bag.messages.size(); begin += count) {
      std::string records = begin == 0 ? channels : "";
      const std::size_t end = std::min(begin + count, bag.messages.size());
      for (std::size_t k = begin; k < end; ++k) records += record_of(bag.messages[k]);
      const std::string compression = options.compression == "none" ? "" : options.compression;
      const std::string packed = Compressed(options.compression, records);
      bytes += McapRecord(6,
                          Number(static_cast<std::uint64_t>(bag.messages[begin].time_ns), 8) +
                              Number(static_cast<std::uint64_t>(bag.messages[end - 1].time_ns), 8) +
                              Number(records.size(), 8) + Number(0, 4) + Counted(compression) +
                              Number(packed.size(), 8) + packed);
    }
  }
  if (!options.has_index) return bytes;
  bytes += McapRecord(15, Number(0, 4));
  const std::size_t summary = bytes.size();
  return bytes + channels + McapRecord(2, Number(summary, 8) + Number(0, 8) + Number(0, 4)) + magic;
}

void WriteSqliteBag(const std::filesystem::path& file, const TestBag& bag) {
  sqlite3* database = nullptr;
  const auto check = [&](int status) {
    if (status != SQLITE_OK && status != SQLITE_DONE) {
      throw std::logic_error(sqlite3_errmsg(database));
    }
  };
  check(sqlite3_open(file.c_str(), &database));
  check(sqlite3_exec(
      database,
      "CREATE TABLE topics(id INTEGER PRIMARY KEY,name TEXT NOT NULL,type TEXT NOT "
      "NULL,serialization_format TEXT NOT NULL,offered_qos_profiles TEXT NOT NULL);"
      "CREATE TABLE messages(id INTEGER PRIMARY KEY,topic_id INTEGER NOT NULL,timestamp INTEGER "
      "NOT NULL, data BLOB NOT NULL);"
      "CREATE INDEX timestamp_idx ON messages (timestamp ASC); BEGIN",
      nullptr,
      nullptr,
      nullptr));
  sqlite3_stmt* statement = nullptr;
  check(sqlite3_prepare_v2(
      database, "INSERT INTO topics VALUES(?1,?2,?3,?4,'')", -1, &statement, nullptr));
  for (std::size_t k = 0; k < bag.topics.size(); ++k) {
    const TestTopic& topic = bag.topics[k];
    std::string type = topic.type;
    type.insert(type.find('/'), "/msg");
    sqlite3_bind_int64(statement, 1, static_cast<sqlite3_int64>(k) + 1);
    sqlite3_bind_text(statement, 2, topic.name.c_str(), -1, SQLITE_TRANSIENT);
    sqlite3_bind_text(statement, 3, type.c_str(), -1, SQLITE_TRANSIENT);
    sqlite3_bind_text(statement,
                      4,
                      topic.encoding.empty() ? "cdr" : topic.encoding.c_str(),
                      -1,
                      SQLITE_TRANSIENT);
    check(sqlite3_step(statement));
    sqlite3_reset(statement);
  }
  sqlite3_finalize(statement);
  check(sqlite3_prepare_v2(database,
                           "INSERT INTO messages(topic_id,timestamp,data) VALUES(?1,?2,?3)",
                           -1,
                           &statement,
                           nullptr));
  for (const TestMessage& message : bag.messages) {
    sqlite3_bind_int64(statement, 1, static_cast<sqlite3_int64>(message.topic) + 1);
    sqlite3_bind_int64(statement, 2, message.time_ns);
    sqlite3_bind_blob(statement,
                      3,
                      message.bytes.data(),
                      static_cast<int>(message.bytes.size()),
                      SQLITE_TRANSIENT);
    check(sqlite3_step(statement));
    sqlite3_reset(statement);
  }
  sqlite3_finalize(statement);
  check(sqlite3_exec(database, "COMMIT", nullptr, nullptr, nullptr));
  check(sqlite3_close(database));
}

bool CanCompress(const std::string& compression) {
#ifdef ROTSLAM_HAVE_BZIP2
  if (compression == "bz2") return true;
#endif
#ifdef ROTSLAM_HAVE_LZ4
  if (compression == "lz4") return true;
#endif
#ifdef ROTSLAM_HAVE_ZSTD
  if (compression == "zstd") return true;
#endif
  return compression == "none";
}

std::string Compressed(const std::string& compression, const std::string& bytes) {
  if (compression == "none") return bytes;
  std::string packed(2 * bytes.size() + 1000, '\0');
  std::size_t size = 0;
#ifdef ROTSLAM_HAVE_BZIP2
  if (compression == "bz2") {
    auto written = static_cast<unsigned>(packed.size());
    BZ2_bzBuffToBuffCompress(packed.data(),
                             &written,
                             const_cast<char*>(bytes.data()),
                             static_cast<unsigned>(bytes.size()),
                             9,
                             0,
                             0);
    size = written;
  }
#endif
#ifdef ROTSLAM_HAVE_LZ4
  if (compression == "lz4") {
    size = LZ4F_compressFrame(packed.data(), packed.size(), bytes.data(), bytes.size(), nullptr);
  }
#endif
#ifdef ROTSLAM_HAVE_ZSTD
  if (compression == "zstd") {
    size = ZSTD_compress(packed.data(), packed.size(), bytes.data(), bytes.size(), 3);
  }
#endif
  packed.resize(size);
  return packed;
}

}  // namespace rotslam
