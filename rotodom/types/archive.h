#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <map>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "rotodom/types/ids.h"
#include "rotodom/types/rotation.h"

namespace rotslam {

// Values as bytes, one behind another, to the last bit, for the same program to take back. What a
// type consists of is said once, for both directions:
//
//   template <class Archive>
//   void Transfer(Archive& archive) { archive(first_, second_); }
//
// or, beside a struct with public fields, by an overload of TransferValue; structured bindings make
// that one fail to compile when a field is added.

class ArchiveWriter {
 public:
  static constexpr bool kIsReader = false;

  template <class... Values>
  void operator()(Values&... values) {
    (TransferValue(*this, values), ...);
  }
  void Bytes(const void* data, std::size_t num_bytes) {
    bytes_.append(static_cast<const char*>(data), num_bytes);
  }
  std::size_t Count(std::size_t count, std::size_t /*bytes_each*/) {
    Bytes(&count, sizeof(count));
    return count;
  }
  std::string TakeBytes() { return std::move(bytes_); }

 private:
  std::string bytes_;
};

/// Throws std::runtime_error where the bytes end too early.
class ArchiveReader {
 public:
  static constexpr bool kIsReader = true;

  /// @param bytes  must stay while this lives.
  explicit ArchiveReader(std::string_view bytes) : bytes_(bytes) {}

  template <class... Values>
  void operator()(Values&... values) {
    (TransferValue(*this, values), ...);
  }
  void Bytes(void* data, std::size_t num_bytes) {
    if (num_bytes > bytes_.size()) throw std::runtime_error("is cut short");
    if (num_bytes > 0) std::memcpy(data, bytes_.data(), num_bytes);
    bytes_.remove_prefix(num_bytes);
  }
  // A number of things to come, each of at least so many bytes: no memory is asked for that the
  // bytes cannot fill.
  std::size_t Count(std::size_t /*count*/, std::size_t bytes_each) {
    std::size_t count = 0;
    Bytes(&count, sizeof(count));
    if (count > bytes_.size() / bytes_each) throw std::runtime_error("is cut short");
    return count;
  }
  void ExpectEnd() const {
    if (!bytes_.empty()) throw std::runtime_error("is longer than its counts say");
  }

 private:
  std::string_view bytes_;
};

namespace internal {

// Whose bytes in memory are all there is to them, without gaps.
template <class T>
constexpr bool kIsPlain = std::is_arithmetic_v<T> || std::is_enum_v<T>;
template <>
inline constexpr bool kIsPlain<bool> = false;  // other bytes than 0 and 1 must not become one
template <class Tag>
constexpr bool kIsPlain<Id<Tag>> = true;
template <class T, std::size_t N>
constexpr bool kIsPlain<std::array<T, N>> = kIsPlain<T>;
template <class T, int R, int C, int O, int MR, int MC>
constexpr bool kIsPlain<Eigen::Matrix<T, R, C, O, MR, MC>> =
    kIsPlain<T>&& R != Eigen::Dynamic&& C != Eigen::Dynamic;
// Its constructor would normalise it once more, which may move the last bit.
template <>
inline constexpr bool kIsPlain<Rotation> = sizeof(Rotation) == 4 * sizeof(double);

}  // namespace internal

template <class Archive, class Value>
void TransferValue(Archive& archive, Value& value) {
  if constexpr (internal::kIsPlain<Value>) {
    archive.Bytes(static_cast<void*>(&value), sizeof(Value));
  } else {
    value.Transfer(archive);
  }
}

template <class Archive>
void TransferValue(Archive& archive, bool& value) {
  auto byte = static_cast<std::uint8_t>(value);
  archive(byte);
  value = byte != 0;
}

template <class Archive>
void TransferValue(Archive& archive, std::string& text) {
  text.resize(archive.Count(text.size(), 1));
  archive.Bytes(text.data(), text.size());
}

template <class Archive, class T>
void TransferValue(Archive& archive, std::vector<T>& values) {
  if constexpr (internal::kIsPlain<T>) {
    values.resize(archive.Count(values.size(), sizeof(T)));
    archive.Bytes(static_cast<void*>(values.data()), values.size() * sizeof(T));
  } else if constexpr (Archive::kIsReader) {
    // One by one: of a count that the bytes do fill, each may yet stand for hundreds in memory.
    values.clear();
    for (std::size_t left = archive.Count(0, 1); left > 0; --left) archive(values.emplace_back());
  } else {
    archive.Count(values.size(), 1);
    for (T& value : values) archive(value);
  }
}

template <class Archive>
void TransferValue(Archive& archive, std::vector<bool>& values) {
  values.resize(archive.Count(values.size(), 1));
  for (std::size_t k = 0; k < values.size(); ++k) {
    bool value = values[k];
    archive(value);
    values[k] = value;
  }
}

template <class Archive, class T, int O, int MR, int MC>
void TransferValue(Archive& archive,
                   Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic, O, MR, MC>& matrix) {
  const auto rows = archive.Count(static_cast<std::size_t>(matrix.rows()), sizeof(T));
  const auto cols = archive.Count(static_cast<std::size_t>(matrix.cols()),
                                  std::max<std::size_t>(rows, 1) * sizeof(T));
  matrix.resize(static_cast<Eigen::Index>(rows), static_cast<Eigen::Index>(cols));
  archive.Bytes(matrix.data(), static_cast<std::size_t>(matrix.size()) * sizeof(T));
}

template <class Archive, class T>
void TransferValue(Archive& archive, std::optional<T>& value) {
  bool has_value = value.has_value();
  archive(has_value);
  if (!has_value) {
    value.reset();
    return;
  }
  if constexpr (Archive::kIsReader) value.emplace();
  archive(*value);
}

template <class Archive, class T>
void TransferValue(Archive& archive, std::shared_ptr<T>& value) {
  if constexpr (Archive::kIsReader) value = std::make_shared<T>();
  archive(*value);
}

template <class Archive, class First, class Second>
void TransferValue(Archive& archive, std::pair<First, Second>& pair) {
  archive(pair.first, pair.second);
}

template <class Archive, class Key, class Value>
void TransferValue(Archive& archive, std::map<Key, Value>& values) {
  if constexpr (Archive::kIsReader) {
    values.clear();
    for (std::size_t left = archive.Count(0, 1); left > 0; --left) {
      Key key;
      archive(key);
      archive(values[key]);
    }
  } else {
    archive.Count(values.size(), 1);
    for (auto& [key, value] : values) {
      Key copy = key;
      archive(copy, value);
    }
  }
}

}  // namespace rotslam
