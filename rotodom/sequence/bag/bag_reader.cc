#include "rotodom/sequence/bag/bag_reader.h"

#include <algorithm>
#include <stdexcept>

#include "rotodom/sequence/bag/decompress.h"

namespace rotslam {

std::string PrintableText(std::string text) {
  for (char& letter : text) {
    if (static_cast<unsigned char>(letter) < ' ' || letter == '\x7f') letter = '?';
  }
  return text;
}

std::size_t BagReader::AddTopic(BagTopic topic) {
  topic.name = PrintableText(std::move(topic.name));
  topic.type = PrintableText(std::move(topic.type));
  topic.encoding = PrintableText(std::move(topic.encoding));
  const auto same = [&](const BagTopic& other) {
    return other.name == topic.name && other.type == topic.type && other.encoding == topic.encoding;
  };
  const auto known = std::find_if(topics_.begin(), topics_.end(), same);
  if (known != topics_.end()) return static_cast<std::size_t>(known - topics_.begin());
  is_wanted_.push_back(wanted_(topic));
  topics_.push_back(std::move(topic));
  return topics_.size() - 1;
}

std::size_t BagReader::NumFirstBytes(std::uint64_t size) {
  constexpr std::uint64_t kShortMessage = 2048;
  return static_cast<std::size_t>(size <= kShortMessage ? size : BagEntry::kHeadSize);
}

void BagReader::AddMessage(const BagEntry& entry, std::string_view head) {
  ++topics_[entry.topic].count;
  if (!is_wanted_[entry.topic]) return;
  BagEntry kept = entry;
  std::string unpacked;
  if (topics_[entry.topic].encoding == "cdr" && IsZstdFrame(head)) {
    if (!CanDecompress("zstd"))
      unpacked = Decompressed(entry, BagEntry::kHeadSize);  // says why not
    try {
      unpacked = Decompressed(entry, BagEntry::kHeadSize);
    } catch (const std::runtime_error&) {
      ++num_bad_messages_;
      return;
    }
    head = unpacked;
  }
  if (unpacked.empty() && head.size() > kept.head.size() && head.size() == entry.size) {
    kept.checksum = std::hash<std::string_view>()(head.substr(kept.head.size()));
  }
  std::copy_n(head.begin(), std::min(head.size(), kept.head.size()), kept.head.begin());
  entries_.push_back(kept);
}

void BagReader::AddBadChunk(const std::string& reason) {
  ++num_bad_chunks_;
  if (first_bad_chunk_.empty()) first_bad_chunk_ = reason;
}

void BagReader::Finish() {
  if (num_bad_chunks_ > 0) {
    notes_.push_back("chunks that are left out: " + std::to_string(num_bad_chunks_) +
                     "; the first: " + first_bad_chunk_);
  }
  if (num_bad_messages_ > 0) {
    notes_.push_back("messages that are left out: " + std::to_string(num_bad_messages_) +
                     ", whose zstd data are damaged");
  }
  if (num_without_topic_ > 0) {
    notes_.push_back("messages that are left out: " + std::to_string(num_without_topic_) +
                     ", whose topic no record tells");
  }
  if (topics_.empty()) {
    Fail("nothing can be read" + (notes_.empty() ? ": it holds no topics" : ": " + notes_[0]));
  }
  std::stable_sort(entries_.begin(), entries_.end(), [](const BagEntry& a, const BagEntry& b) {
    return a.time_ns < b.time_ns;
  });
}

std::string BagReader::Read(const BagEntry& entry) {
  std::string bytes = ReadStored(entry);
  if (topics_[entry.topic].encoding == "cdr" && IsZstdFrame(bytes)) {
    return Decompressed(entry, ~std::uint64_t{0});
  }
  return bytes;
}

std::string BagReader::Decompressed(const BagEntry& entry, std::uint64_t most_bytes) {
  const std::string packed = ReadStored(entry);
  try {
    std::string bytes = DecompressMessage(packed, most_bytes);
    bytes.resize(static_cast<std::size_t>(std::min<std::uint64_t>(bytes.size(), most_bytes)));
    return bytes;
  } catch (const std::runtime_error& error) {
    Fail("a message of " + topics_[entry.topic].name + ": " + error.what());
  }
}

void BagReader::Fail(const std::string& reason) const {
  throw std::runtime_error(path_.string() + ": " + PrintableText(reason));
}

}  // namespace rotslam
