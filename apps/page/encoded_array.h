#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include <nlohmann/json.hpp>

namespace rotslam {

/// Encodes binary data as base64.
std::string Base64(std::string_view bytes);

/// Numbers as the pages' scripts decode them: {"type", "columns", "data"}, little-endian in base64,
/// in rows of `columns`.
template <class T>
nlohmann::ordered_json EncodedArray(const std::vector<T>& values, int columns) {
  static_assert(std::is_same_v<T, float> || std::is_same_v<T, std::int32_t> ||
                std::is_same_v<T, std::uint16_t> || std::is_same_v<T, std::uint8_t>);
  const char* const type = std::is_same_v<T, float>           ? "f32"
                           : std::is_same_v<T, std::int32_t>  ? "i32"
                           : std::is_same_v<T, std::uint16_t> ? "u16"
                                                              : "u8";
  const std::string_view bytes(reinterpret_cast<const char*>(values.data()),
                               values.size() * sizeof(T));
  return {{"type", type}, {"columns", columns}, {"data", Base64(bytes)}};
}

}  // namespace rotslam
