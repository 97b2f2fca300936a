#include "output/files/binary_file.h"

#include <stdexcept>

#include "rotodom/types/text_file.h"

namespace rotslam {

BinaryReader::BinaryReader(const std::filesystem::path& file)
    : file_(file), bytes_(ReadBytes(file)) {}

std::string_view BinaryReader::Take(std::uint64_t num_bytes) {
  if (bytes_.size() - at_ < num_bytes) Fail("is cut short");
  const std::string_view bytes(bytes_.data() + at_, num_bytes);
  at_ += num_bytes;
  return bytes;
}

std::uint64_t BinaryReader::Count(const char* what, std::uint64_t bytes_each) {
  const auto count = Get<std::uint64_t>();
  if (count > (bytes_.size() - at_) / bytes_each) {
    Fail("says " + std::to_string(count) + " " + what + ", but has only " +
         std::to_string(bytes_.size() - at_) + " bytes more");
  }
  return count;
}

std::string BinaryReader::Name() {
  const std::size_t end = bytes_.find('\0', at_);
  if (end == std::string::npos) Fail("is cut short");
  std::string name = bytes_.substr(at_, end - at_);
  at_ = end + 1;
  return name;
}

void BinaryReader::ExpectEnd() const {
  if (at_ != bytes_.size()) Fail("is longer than its counts say");
}

void BinaryReader::Fail(const std::string& reason) const {
  throw std::runtime_error(file_.string() + ": " + reason);
}

}  // namespace rotslam
