// ROS 1 bags as http://wiki.ros.org/Bags/Format/2.0 describes them: records of a header (fields
// `name=value`) and data, each behind its length; chunks hold such records again. Read here and not
// with librosbag-storage, which runs out of its buffers when an index is damaged.

#include <algorithm>
#include <map>
#include <optional>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "rotodom/sequence/bag/bag_file.h"
#include "rotodom/sequence/bag/bag_reader.h"
#include "rotodom/sequence/bag/byte_reader.h"
#include "rotodom/sequence/bag/decompress.h"

namespace rotslam {
namespace {

constexpr std::string_view kRos1Magic = "#ROSBAG V2.0\n";

// Kinds of records, their field `op`.
enum class Ros1Op : unsigned char {
  kMessage = 2,
  kBagHeader = 3,
  kIndex = 4,
  kChunk = 5,
  kChunkInfo = 6,
  kConnection = 7,
};

// The fields of a header that are read here.
struct Ros1Header {
  Ros1Op op = Ros1Op::kIndex;
  std::uint32_t connection = 0;
  std::int64_t time_ns = 0;
  std::uint32_t raw_size = 0;
  std::string topic;
  std::string type;
  std::string compression;
  std::string encryptor;
};

// Sets what a list of fields says; false when it is malformed.
bool ParseRos1Fields(std::string_view bytes, Ros1Header* header) {
  ByteReader fields(bytes);
  while (fields.left() > 0) {
    const std::string_view field = fields.TakeCounted();
    const std::size_t equals = field.find('=');
    if (fields.Failed() || equals == std::string_view::npos) return false;
    const std::string_view name = field.substr(0, equals);
    const std::string_view text = field.substr(equals + 1);
    ByteReader value(text);
    if (name == "op") {
      header->op = static_cast<Ros1Op>(value.Read<std::uint8_t>());
    } else if (name == "conn") {
      header->connection = value.Read<std::uint32_t>();
    } else if (name == "time") {
      const auto seconds = value.Read<std::uint32_t>();
      const auto nanoseconds = value.Read<std::uint32_t>();
      header->time_ns = std::int64_t{seconds} * 1'000'000'000 + nanoseconds;
    } else if (name == "size") {
      header->raw_size = value.Read<std::uint32_t>();
    } else if (name == "topic") {
      header->topic = text;
    } else if (name == "type") {
      header->type = text;
    } else if (name == "compression") {
      header->compression = text;
    } else if (name == "encryptor") {
      header->encryptor = text;
    }
    if (value.Failed()) return false;
  }
  return true;
}

// Records one after another: those of the file, or of a chunk in memory.
struct Ros1Records {
  BagFile* file = nullptr;  // of these two the one that is not empty
  std::string_view memory;
  std::size_t chunk = 0;     // for BagEntry
  std::uint64_t offset = 0;  // of the next record
  std::uint64_t end = 0;

  std::string_view Peek(std::uint64_t at, std::size_t size) const {
    if (at >= end) return {};
    size = static_cast<std::size_t>(std::min<std::uint64_t>(size, end - at));
    return file != nullptr ? file->Peek(at, size) : memory.substr(at, size);
  }
};

struct Ros1Record {
  Ros1Header header;
  std::uint64_t data_offset = 0;
  std::uint64_t data_size = 0;
};

// The header of the next record; nullopt when it is malformed or cut off.
std::optional<Ros1Record> NextRos1Record(const Ros1Records& records) {
  constexpr std::uint32_t kMostHeaderBytes = 1 << 20;
  ByteReader length(records.Peek(records.offset, 4));
  const auto header_size = length.Read<std::uint32_t>();
  if (length.Failed() || header_size > kMostHeaderBytes ||
      header_size > records.end - records.offset) {
    return std::nullopt;
  }
  ByteReader reader(records.Peek(records.offset + 4, std::size_t{header_size} + 4));
  Ros1Record record;
  const std::string_view fields = reader.Take(header_size);
  record.data_size = reader.Read<std::uint32_t>();
  record.data_offset = records.offset + 8 + header_size;
  if (reader.Failed() || !ParseRos1Fields(fields, &record.header)) return std::nullopt;
  return record;
}

class Ros1Bag : public BagReader {
 public:
  Ros1Bag(const std::filesystem::path& path, const BagFilter& wanted)
      : BagReader(path, wanted), file_(path) {
    if (file_.Peek(0, kRos1Magic.size()) != kRos1Magic) {
      file_.Fail("is no ROS 1 bag of version 2.0; older ones: run `rosbag migrate`");
    }
    chunks_.emplace_back();  // number 0: the file itself
    Scan({&file_, {}, 0, kRos1Magic.size(), file_.size()});
    Finish();
  }

 private:
  std::string ReadStored(const BagEntry& entry) override {
    if (entry.chunk == 0) return file_.Read(entry.offset, entry.size);
    return std::string(file_.Decompressed(chunks_[entry.chunk]).substr(entry.offset, entry.size));
  }

  // Walks over records, those of chunks included. Stops at the first that is malformed.
  void Scan(Ros1Records records) {
    while (records.offset < records.end) {
      const std::optional<Ros1Record> record = NextRos1Record(records);
      if (!record) return NoteEnd(records, "a record is malformed");
      const std::uint64_t data_end = record->data_offset + record->data_size;
      const bool is_whole = data_end <= records.end;
      switch (record->header.op) {
        case Ros1Op::kMessage:
          if (is_whole) AddRecord(records, *record);
          break;
        case Ros1Op::kConnection:
          if (is_whole) AddConnection(records, *record);
          break;
        case Ros1Op::kBagHeader:
          if (!record->header.encryptor.empty()) {
            file_.Fail("is encrypted (" + record->header.encryptor +
                       "); run `rosbag decrypt` first");
          }
          break;
        case Ros1Op::kChunk:
          if (records.chunk == 0 && records.file != nullptr) ScanChunk(*record);
          break;
        default:
          break;  // the index, which is not needed
      }
      if (!is_whole) return NoteEnd(records, "the file is cut off");
      records.offset = data_end;
    }
  }

  void ScanChunk(const Ros1Record& record) {
    const std::uint64_t left = file_.size() - record.data_offset;
    const std::string& compression = record.header.compression;
    if (compression == "none") {
      const std::uint64_t size = std::min(record.data_size, left);
      // Its records are read like those of the file, but a chunk in a chunk is passed over.
      if (in_chunk_) return;
      in_chunk_ = true;
      Scan({&file_, {}, 0, record.data_offset, record.data_offset + size});
      in_chunk_ = false;
      return;
    }
    if (in_chunk_ || record.data_size > left) return;
    BagChunk chunk = {record.data_offset, record.data_size, compression, record.header.raw_size};
    if (!CanDecompress(compression) && (compression == "bz2" || compression == "lz4")) {
      file_.Decompressed(chunk);  // says what is missing
    }
    std::string_view bytes;
    try {
      bytes = file_.Decompressed(chunk);
    } catch (const std::runtime_error& error) {
      return AddBadChunk(error.what());
    }
    chunks_.push_back(std::move(chunk));
    Scan({nullptr, bytes, chunks_.size() - 1, 0, bytes.size()});
  }

  void AddConnection(const Ros1Records& records, const Ros1Record& record) {
    constexpr std::uint64_t kMostBytes = 1 << 20;
    Ros1Header inner;
    const auto size = static_cast<std::size_t>(std::min(record.data_size, kMostBytes));
    if (!ParseRos1Fields(records.Peek(record.data_offset, size), &inner)) return;
    topic_of_connection_.emplace(record.header.connection,
                                 AddTopic({record.header.topic, inner.type, "ros1"}));
  }

  void AddRecord(const Ros1Records& records, const Ros1Record& record) {
    const auto topic = topic_of_connection_.find(record.header.connection);
    if (topic == topic_of_connection_.end()) {
      AddMessageWithoutTopic();
      return;
    }
    BagEntry entry;
    entry.topic = topic->second;
    entry.time_ns = record.header.time_ns;
    entry.size = record.data_size;
    entry.chunk = records.chunk;
    entry.offset = record.data_offset;
    AddMessage(entry, records.Peek(record.data_offset, NumFirstBytes(record.data_size)));
  }

  void NoteEnd(const Ros1Records& records, const std::string& reason) {
    std::string place = "byte " + std::to_string(records.offset);
    if (records.chunk != 0) {
      place += " of the chunk at byte " + std::to_string(chunks_[records.chunk].offset);
    }
    // The chunk that is cut off says the same of itself.
    if (!notes_.empty() && reason == "the file is cut off") return;
    notes_.push_back(reason + " at " + place + "; what lies behind it is left out");
  }

  BagFile file_;
  std::vector<BagChunk> chunks_;
  std::map<std::uint32_t, std::size_t> topic_of_connection_;
  bool in_chunk_ = false;
};

}  // namespace

std::unique_ptr<BagReader> OpenRos1Bag(const std::filesystem::path& file, const BagFilter& wanted) {
  return std::make_unique<Ros1Bag>(file, wanted);
}

}  // namespace rotslam
