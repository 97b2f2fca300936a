#pragma once

#include <cstdint>
#include <cstring>
#include <filesystem>
#include <string>
#include <string_view>

namespace rotslam {

/// Little-endian numbers (as x86 and ARM have them) of a file in memory, taken one by one. Throws
/// std::runtime_error with the file's path where it ends too early.
class BinaryReader {
 public:
  /// Throws std::runtime_error when the file cannot be read.
  explicit BinaryReader(const std::filesystem::path& file);

  template <class T>
  T Get() {
    T value;
    std::memcpy(&value, Take(sizeof(T)).data(), sizeof(T));
    return value;
  }
  /// The next so many bytes.
  std::string_view Take(std::uint64_t num_bytes);
  /// A count of things to come, each of at least so many bytes.
  std::uint64_t Count(const char* what, std::uint64_t bytes_each);
  /// Text up to a zero byte, which is taken, too.
  std::string Name();
  void ExpectEnd() const;
  [[noreturn]] void Fail(const std::string& reason) const;
  const std::filesystem::path& file() const { return file_; }

 private:
  std::filesystem::path file_;
  std::string bytes_;
  std::size_t at_ = 0;
};

/// The other direction, into a string.
class BinaryWriter {
 public:
  template <class T>
  void Put(T value) {
    char bytes[sizeof(T)];
    std::memcpy(bytes, &value, sizeof(T));
    bytes_.append(bytes, sizeof(T));
  }
  /// Text and a zero byte.
  void PutName(const std::string& name) { bytes_.append(name.c_str(), name.size() + 1); }
  const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

}  // namespace rotslam
