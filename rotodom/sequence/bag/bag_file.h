#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <list>
#include <string>
#include <string_view>
#include <vector>

namespace rotslam {

/// Compressed records of a bag's file.
struct BagChunk {
  std::uint64_t offset = 0;  // of its bytes in the file
  std::uint64_t size = 0;
  std::string compression;     // "bz2", "lz4" or "zstd"
  std::uint64_t raw_size = 0;  // decompressed, as the file claims
};

/// A file that is read at any place. Keeps the chunks that were decompressed last.
class BagFile {
 public:
  /// Throws std::runtime_error naming `path` when it cannot be opened.
  explicit BagFile(std::filesystem::path path);

  const std::filesystem::path& path() const { return path_; }
  std::uint64_t size() const { return size_; }

  /// Bytes of the file, fewer at its end; valid until the next call. For short pieces that lie
  /// close together.
  std::string_view Peek(std::uint64_t offset, std::size_t size);

  /// Bytes of the file. Throws std::runtime_error naming the file when they are not all there.
  std::string Read(std::uint64_t offset, std::uint64_t size);

  /// The chunk's bytes, decompressed; valid until the next call but one. Throws
  /// std::runtime_error naming the file when they are damaged, or the program was built without
  /// the decompressor.
  std::string_view Decompressed(const BagChunk& chunk);

  [[noreturn]] void Fail(const std::string& reason) const;

 private:
  struct Kept {
    std::uint64_t offset = 0;
    std::string bytes;
  };

  std::filesystem::path path_;
  std::ifstream stream_;
  std::uint64_t size_ = 0;
  std::uint64_t window_offset_ = 0;
  std::string window_;
  std::list<Kept> kept_;
};

}  // namespace rotslam
