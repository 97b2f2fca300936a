#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string>
#include <string_view>

namespace rotslam {

/// The valid part of a journal: records appended behind it count as never written.
struct JournalExtent {
  std::uint64_t num_records = 0;
  std::uint64_t num_bytes = 0;
  std::uint64_t checksum = 0;  // of their lengths and checksums
};

/// 64 bits that change with every byte: FNV-1a. No protection against intent.
std::uint64_t Checksum(std::string_view bytes, std::uint64_t before = 0xcbf29ce484222325);

/// A file that grows record by record; each has its length and a checksum in front.
class JournalWriter {
 public:
  /// Opens the file, made if it is not there, and cuts it off behind `extent`. Throws
  /// std::runtime_error naming it and the reason; so do the others.
  JournalWriter(std::filesystem::path path, const JournalExtent& extent);
  ~JournalWriter();
  JournalWriter(const JournalWriter&) = delete;
  JournalWriter& operator=(const JournalWriter&) = delete;

  void Append(std::string_view record);
  /// Returns when all that was appended is on the disk, whatever happens to the machine.
  void Sync();
  /// Cuts off what is behind `extent`, which gives its room back.
  void CutOff(const JournalExtent& extent);

  const JournalExtent& extent() const { return extent_; }

 private:
  [[noreturn]] void Refuse(int error) const;

  std::filesystem::path path_;
  int file_ = -1;
  JournalExtent extent_;
};

/// The records of a journal, one by one.
class JournalReader {
 public:
  /// Throws std::runtime_error where the file cannot be read or is shorter than `extent` says.
  JournalReader(std::filesystem::path path, const JournalExtent& extent);

  /// nullopt after the last one. Throws std::runtime_error, with the path, where it is damaged.
  std::optional<std::string> Next();

 private:
  std::filesystem::path path_;
  std::ifstream stream_;
  JournalExtent extent_;
  JournalExtent read_;
};

}  // namespace rotslam
