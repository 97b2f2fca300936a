#include "apps/page/encoded_array.h"

#include <algorithm>
#include <cstddef>

namespace rotslam {

std::string Base64(std::string_view bytes) {
  constexpr std::string_view kDigits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t k = 0; k < bytes.size(); k += 3) {
    const std::size_t count = std::min<std::size_t>(3, bytes.size() - k);
    std::uint32_t word = 0;
    for (std::size_t n = 0; n < 3; ++n) {
      word = (word << 8) | (n < count ? static_cast<unsigned char>(bytes[k + n]) : 0U);
    }
    for (std::size_t n = 0; n < 4; ++n) {
      text += n <= count ? kDigits[(word >> (18 - 6 * n)) & 63U] : '=';
    }
  }
  return text;
}

}  // namespace rotslam
