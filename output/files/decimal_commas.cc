#include "output/files/decimal_commas.h"

#include <algorithm>

namespace rotslam {
namespace {

bool IsDigit(char c) { return c >= '0' && c <= '9'; }

// The lines that carry data, one by one, until `visit` returns false.
template <class Visitor>
bool EveryLine(std::string_view text, Visitor visit) {
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    const std::string_view line = text.substr(begin, end - begin);
    begin = end + 1;
    const std::size_t first = line.find_first_not_of(" \t");
    if (first == std::string_view::npos || line[first] == '#') continue;
    if (!visit(line)) return false;
  }
  return true;
}

}  // namespace

bool HasDecimalCommas(std::string_view text) {
  bool has_comma = false;
  const bool all_fit = EveryLine(text, [&](std::string_view line) {
    bool comma_in_word = false;
    for (std::size_t k = 0; k < line.size(); ++k) {
      const char c = line[k];
      if (c == '.') return false;
      if (c == ' ' || c == '\t' || c == ';' || c == '\r') comma_in_word = false;
      if (c != ',') continue;
      const bool between_digits =
          k > 0 && k + 1 < line.size() && IsDigit(line[k - 1]) && IsDigit(line[k + 1]);
      if (!between_digits || comma_in_word) return false;
      comma_in_word = has_comma = true;
    }
    return true;
  });
  return all_fit && has_comma;
}

std::string WithDecimalPoints(std::string text) {
  for (std::size_t k = 1; k + 1 < text.size(); ++k) {
    if (text[k] == ',' && IsDigit(text[k - 1]) && IsDigit(text[k + 1])) text[k] = '.';
  }
  return text;
}

}  // namespace rotslam
