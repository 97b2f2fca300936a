#include "output/files/journal.h"

#include <array>
#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <unistd.h>

namespace rotslam {
namespace {

// In front of each record.
struct RecordHead {
  std::uint64_t num_bytes = 0;
  std::uint64_t checksum = 0;
};

std::string_view BytesOf(const RecordHead& head) {
  return {reinterpret_cast<const char*>(&head), sizeof(head)};
}

void Extend(const RecordHead& head, JournalExtent& extent) {
  ++extent.num_records;
  extent.num_bytes += sizeof(head) + head.num_bytes;
  extent.checksum = Checksum(BytesOf(head), extent.checksum);
}

}  // namespace

std::uint64_t Checksum(std::string_view bytes, std::uint64_t before) {
  std::uint64_t sum = before;
  for (const char byte : bytes) {
    sum = (sum ^ static_cast<unsigned char>(byte)) * std::uint64_t{0x100000001b3};
  }
  return sum;
}

JournalWriter::JournalWriter(std::filesystem::path path, const JournalExtent& extent)
    : path_(std::move(path)) {
  file_ = open(path_.c_str(), O_WRONLY | O_CREAT | O_NOFOLLOW | O_CLOEXEC, 0666);
  if (file_ < 0) Refuse(errno);
  CutOff(extent);
}

JournalWriter::~JournalWriter() { close(file_); }

void JournalWriter::Append(std::string_view record) {
  const RecordHead head = {record.size(), Checksum(record)};
  for (std::string_view left : {BytesOf(head), record}) {
    while (!left.empty()) {
      const ssize_t count = write(file_, left.data(), left.size());
      if (count < 0 && errno == EINTR) continue;
      if (count < 0) Refuse(errno);
      left.remove_prefix(static_cast<std::size_t>(count));
    }
  }
  Extend(head, extent_);
}

void JournalWriter::Sync() {
  if (fsync(file_) != 0) Refuse(errno);
}

void JournalWriter::CutOff(const JournalExtent& extent) {
  const auto end = static_cast<off_t>(extent.num_bytes);
  if (ftruncate(file_, end) != 0 || lseek(file_, end, SEEK_SET) < 0) Refuse(errno);
  extent_ = extent;
}

void JournalWriter::Refuse(int error) const {
  throw std::runtime_error(path_.string() +
                           ": cannot write the file: " + std::generic_category().message(error));
}

JournalReader::JournalReader(std::filesystem::path path, const JournalExtent& extent)
    : path_(std::move(path)), stream_(path_, std::ios::binary), extent_(extent) {
  std::error_code error;
  const std::uintmax_t num_bytes = std::filesystem::file_size(path_, error);
  if (error || !stream_) throw std::runtime_error(path_.string() + ": cannot be read");
  if (num_bytes < extent.num_bytes) throw std::runtime_error(path_.string() + ": is cut short");
}

std::optional<std::string> JournalReader::Next() {
  if (read_.num_records == extent_.num_records) return std::nullopt;
  const auto damaged = [&]() -> std::runtime_error {
    return std::runtime_error(path_.string() + ": record " + std::to_string(read_.num_records) +
                              " is damaged (checksum)");
  };
  std::array<char, sizeof(RecordHead)> bytes = {};
  if (!stream_.read(bytes.data(), bytes.size())) throw damaged();
  RecordHead head;
  std::memcpy(&head, bytes.data(), sizeof(head));
  // No memory for more than the file can hold.
  if (read_.num_bytes + sizeof(head) > extent_.num_bytes ||
      head.num_bytes > extent_.num_bytes - read_.num_bytes - sizeof(head)) {
    throw damaged();
  }
  std::string record(head.num_bytes, '\0');
  if (!stream_.read(record.data(), static_cast<std::streamsize>(record.size())) ||
      Checksum(record) != head.checksum) {
    throw damaged();
  }
  Extend(head, read_);
  if (read_.num_records == extent_.num_records && read_.checksum != extent_.checksum) {
    throw std::runtime_error(path_.string() + ": is damaged (checksum)");
  }
  return record;
}

}  // namespace rotslam
