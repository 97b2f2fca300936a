#include "rotodom/sequence/bag/bag_file.h"

#include <algorithm>
#include <iterator>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "rotodom/sequence/bag/bag_reader.h"
#include "rotodom/sequence/bag/decompress.h"

namespace rotslam {

namespace fs = std::filesystem;

BagFile::BagFile(fs::path path) : path_(std::move(path)) {
  std::error_code error;
  if (!fs::is_regular_file(path_, error)) Fail("not a file");
  size_ = fs::file_size(path_, error);
  stream_.open(path_, std::ios::binary);
  if (error || !stream_) Fail("cannot be opened");
}

void BagFile::Fail(const std::string& reason) const {
  throw std::runtime_error(path_.string() + ": " + PrintableText(reason));
}

std::string_view BagFile::Peek(std::uint64_t offset, std::size_t size) {
  // Records of small messages share a window; a longer one would read pixels for nothing.
  constexpr std::size_t kWindowSize = 4096;
  if (offset >= size_) return {};
  size = static_cast<std::size_t>(std::min<std::uint64_t>(size, size_ - offset));
  if (offset < window_offset_ || offset + size > window_offset_ + window_.size()) {
    const std::uint64_t wanted =
        std::min<std::uint64_t>(std::max(size, kWindowSize), size_ - offset);
    window_ = Read(offset, wanted);
    window_offset_ = offset;
  }
  return std::string_view(window_).substr(static_cast<std::size_t>(offset - window_offset_), size);
}

std::string BagFile::Read(std::uint64_t offset, std::uint64_t size) {
  if (offset > size_ || size > size_ - offset) Fail("is cut off");
  std::string bytes(static_cast<std::size_t>(size), '\0');
  stream_.clear();
  stream_.seekg(static_cast<std::streamoff>(offset));
  stream_.read(bytes.data(), static_cast<std::streamsize>(size));
  if (!stream_) Fail("cannot be read at byte " + std::to_string(offset));
  return bytes;
}

std::string_view BagFile::Decompressed(const BagChunk& chunk) {
  constexpr std::size_t kMostKept = 2;
  const auto known = std::find_if(
      kept_.begin(), kept_.end(), [&](const Kept& kept) { return kept.offset == chunk.offset; });
  if (known != kept_.end()) {
    kept_.splice(kept_.begin(), kept_, known);
    return kept_.front().bytes;
  }
  // Room is made first, so that there are never more than two.
  if (kept_.size() >= kMostKept) kept_.pop_back();
  const std::string packed = Read(chunk.offset, chunk.size);
  Kept kept;
  kept.offset = chunk.offset;
  try {
    kept.bytes = Decompress(chunk.compression, packed, chunk.raw_size);
  } catch (const std::runtime_error& error) {
    Fail("chunk at byte " + std::to_string(chunk.offset) + ": " + error.what());
  }
  kept_.push_front(std::move(kept));
  return kept_.front().bytes;
}

}  // namespace rotslam
