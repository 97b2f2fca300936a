// MCAP files as https://mcap.dev/spec describes them: records of one byte of kind, eight of length,
// and content; chunks hold schemas, channels and messages again, compressed or not.

#include <algorithm>
#include <map>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "rotodom/sequence/bag/bag_file.h"
#include "rotodom/sequence/bag/bag_reader.h"
#include "rotodom/sequence/bag/byte_reader.h"
#include "rotodom/sequence/bag/decompress.h"
#include "rotodom/sequence/crc32.h"

namespace rotslam {
namespace {

constexpr std::string_view kMcapMagic = "\x89MCAP0\r\n";
constexpr std::uint64_t kMcapRecordHead = 9;  // kind and length

enum class McapOp : unsigned char {
  kFooter = 0x02,
  kSchema = 0x03,
  kChannel = 0x04,
  kMessage = 0x05,
  kChunk = 0x06,
  kDataEnd = 0x0f,
};

// ROS 2 puts "msg" between the package and the name of a type.
std::string PlainType(std::string type) {
  const std::size_t middle = type.find("/msg/");
  if (middle != std::string::npos) type.erase(middle, 4);
  return type;
}

// Records one after another: those of the file, or of a chunk in memory.
struct McapRecords {
  BagFile* file = nullptr;
  std::string_view memory;
  std::size_t chunk = 0;
  std::uint64_t offset = 0;
  std::uint64_t end = 0;

  std::string_view Peek(std::uint64_t at, std::uint64_t size) const {
    if (at >= end) return {};
    const auto peeked = static_cast<std::size_t>(std::min(size, end - at));
    return file != nullptr ? file->Peek(at, peeked) : memory.substr(at, peeked);
  }
};

class McapBag : public BagReader {
 public:
  McapBag(const std::filesystem::path& path, const BagFilter& wanted)
      : BagReader(path, wanted), file_(path) {
    if (file_.Peek(0, kMcapMagic.size()) != kMcapMagic) {
      file_.Fail("is no MCAP file of version 0");
    }
    chunks_.emplace_back();  // number 0: the file itself
    Scan({&file_, {}, 0, kMcapMagic.size(), file_.size()});
    if (!has_ended_ && notes_.empty()) {
      notes_.push_back("the file has no end (cut off, or still being recorded)");
    }
    Finish();
  }

 private:
  std::string ReadStored(const BagEntry& entry) override {
    if (entry.chunk == 0) return file_.Read(entry.offset, entry.size);
    return std::string(file_.Decompressed(chunks_[entry.chunk]).substr(entry.offset, entry.size));
  }

  void Scan(McapRecords records) {
    while (records.offset < records.end && !has_ended_) {
      ByteReader head(records.Peek(records.offset, kMcapRecordHead));
      const auto op = static_cast<McapOp>(head.Read<std::uint8_t>());
      const auto size = head.Read<std::uint64_t>();
      const std::uint64_t begin = records.offset + kMcapRecordHead;
      if (head.Failed() || size > records.end - begin) {
        // The uncompressed chunk that the file ends in.
        if (op == McapOp::kChunk && !head.Failed() && records.file != nullptr) {
          ScanChunk(begin, records.end - begin);
        }
        return NoteEnd(records);
      }
      switch (op) {
        case McapOp::kSchema:
          AddSchema(records.Peek(begin, std::min(size, kMostSmallBytes)));
          break;
        case McapOp::kChannel:
          AddChannel(records.Peek(begin, std::min(size, kMostSmallBytes)));
          break;
        case McapOp::kMessage:
          AddRecord(records, begin, size);
          break;
        case McapOp::kChunk:
          if (records.chunk == 0) ScanChunk(begin, size);
          break;
        case McapOp::kDataEnd:
        case McapOp::kFooter:
          if (records.chunk == 0 && !in_chunk_) has_ended_ = true;
          break;
        default:
          break;  // indexes, attachments, metadata, and what later versions may add
      }
      records.offset = begin + size;
    }
  }

  void ScanChunk(std::uint64_t begin, std::uint64_t size) {
    if (in_chunk_) return;
    ByteReader head(file_.Peek(begin, static_cast<std::size_t>(std::min(size, kMostSmallBytes))));
    head.Take(16);  // the times of its first and last message
    const auto raw_size = head.Read<std::uint64_t>();
    const auto crc = head.Read<std::uint32_t>();
    const std::string compression(head.TakeCounted());
    const auto packed_size = head.Read<std::uint64_t>();
    const std::uint64_t records_begin = begin + head.position();
    const bool is_whole = !head.Failed() && packed_size <= size - head.position();
    if (compression.empty() && !head.Failed()) {
      in_chunk_ = true;
      Scan({&file_,
            {},
            0,
            records_begin,
            records_begin + std::min(packed_size, size - head.position())});
      in_chunk_ = false;
      return;
    }
    if (!is_whole) return AddBadChunk("a chunk is cut off");
    BagChunk chunk = {records_begin, packed_size, compression, raw_size};
    if (!CanDecompress(compression) && (compression == "lz4" || compression == "zstd")) {
      file_.Decompressed(chunk);  // says what is missing
    }
    std::string_view bytes;
    try {
      bytes = file_.Decompressed(chunk);
      if (crc != 0 && Crc32(bytes) != crc) {
        file_.Fail("chunk at byte " + std::to_string(records_begin) + ": checksum is wrong");
      }
    } catch (const std::runtime_error& error) {
      return AddBadChunk(error.what());
    }
    chunks_.push_back(std::move(chunk));
    Scan({nullptr, bytes, chunks_.size() - 1, 0, bytes.size()});
  }

  void AddSchema(std::string_view bytes) {
    ByteReader reader(bytes);
    const auto id = reader.Read<std::uint16_t>();
    const std::string_view name = reader.TakeCounted();
    if (!reader.Failed()) type_of_schema_[id] = PlainType(std::string(name));
  }

  void AddChannel(std::string_view bytes) {
    ByteReader reader(bytes);
    const auto id = reader.Read<std::uint16_t>();
    const auto schema = reader.Read<std::uint16_t>();
    const std::string_view topic = reader.TakeCounted();
    const std::string_view encoding = reader.TakeCounted();
    if (reader.Failed() || topic_of_channel_.contains(id)) return;
    const auto type = type_of_schema_.find(schema);
    topic_of_channel_[id] = AddTopic({std::string(topic),
                                      type == type_of_schema_.end() ? "" : type->second,
                                      std::string(encoding)});
  }

  void AddRecord(const McapRecords& records, std::uint64_t begin, std::uint64_t size) {
    constexpr std::uint64_t kHead = 22;  // channel, number, two times
    const std::uint64_t first = kHead + NumFirstBytes(size - std::min(size, kHead));
    ByteReader reader(records.Peek(begin, std::min(size, first)));
    const auto channel = reader.Read<std::uint16_t>();
    reader.Read<std::uint32_t>();
    const auto log_time = reader.Read<std::uint64_t>();
    reader.Read<std::uint64_t>();
    const auto topic = topic_of_channel_.find(channel);
    if (reader.Failed() || topic == topic_of_channel_.end()) {
      AddMessageWithoutTopic();
      return;
    }
    BagEntry entry;
    entry.topic = topic->second;
    entry.time_ns = static_cast<std::int64_t>(log_time & 0x7fffffffffffffff);
    entry.size = size - kHead;
    entry.chunk = records.chunk;
    entry.offset = begin + kHead;
    AddMessage(entry, reader.Take(reader.left()));
  }

  void NoteEnd(const McapRecords& records) {
    std::string place = "byte " + std::to_string(records.offset);
    if (records.chunk != 0) {
      place += " of the chunk at byte " + std::to_string(chunks_[records.chunk].offset);
    }
    if (notes_.empty()) {
      notes_.push_back("the file is cut off or damaged at " + place +
                       "; what lies behind it is left out");
    }
  }

  // Of records whose first fields alone are needed: schemas end with long texts.
  static constexpr std::uint64_t kMostSmallBytes = 4096;

  BagFile file_;
  std::vector<BagChunk> chunks_;
  std::map<std::uint16_t, std::string> type_of_schema_;
  std::map<std::uint16_t, std::size_t> topic_of_channel_;
  bool in_chunk_ = false;
  bool has_ended_ = false;
};

}  // namespace

std::unique_ptr<BagReader> OpenMcapBag(const std::filesystem::path& file, const BagFilter& wanted) {
  return std::make_unique<McapBag>(file, wanted);
}

}  // namespace rotslam
