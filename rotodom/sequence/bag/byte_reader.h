#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>
#include <type_traits>

namespace rotslam {

/// Reads numbers and texts one after another from bytes that may be damaged. Reading beyond the end
/// gives zeros and empty texts and makes Failed() true from then on; nothing is ever allocated for
/// more than there is.
class ByteReader {
 public:
  explicit ByteReader(std::string_view bytes) : bytes_(bytes) {}

  bool Failed() const { return failed_; }
  std::size_t position() const { return position_; }
  std::size_t left() const { return bytes_.size() - position_; }

  /// A little-endian whole number of 1, 2, 4 or 8 bytes.
  template <class Number>
  Number Read() {
    static_assert(std::is_unsigned_v<Number>);
    const std::string_view bytes = Take(sizeof(Number));
    std::uint64_t number = 0;
    for (std::size_t k = bytes.size(); k > 0; --k) {
      number = number << 8 | static_cast<unsigned char>(bytes[k - 1]);
    }
    return static_cast<Number>(number);
  }

  /// The next `size` bytes, which stay where they are.
  std::string_view Take(std::uint64_t size) {
    if (failed_ || size > left()) {
      failed_ = true;
      return {};
    }
    const std::string_view taken = bytes_.substr(position_, static_cast<std::size_t>(size));
    position_ += taken.size();
    return taken;
  }

  /// Bytes behind their own number, of 4 bytes.
  std::string_view TakeCounted() { return Take(Read<std::uint32_t>()); }

 private:
  std::string_view bytes_;
  std::size_t position_ = 0;
  bool failed_ = false;
};

}  // namespace rotslam
