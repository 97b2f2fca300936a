#include "rotodom/camera/number_table.h"

#include <algorithm>
#include <cstddef>
#include <string>
#include <utility>

namespace rotslam {
namespace {

constexpr std::size_t kMostRows = 4;
constexpr std::size_t kMostNumbers = 32;  // of a line

bool IsDecimalCommaNumber(std::string word) {
  const std::size_t comma = word.find(',');
  if (comma == std::string::npos) return false;
  word[comma] = '.';
  return IsNumber(word);
}

// The numbers of a line; empty where it has something else.
std::vector<std::string> NumbersOfRow(const std::vector<std::string>& words) {
  std::vector<std::string> numbers;
  for (const std::string& word : words) {
    if (words.size() > 1 && IsDecimalCommaNumber(word) && !word.ends_with(',')) {
      numbers.push_back(word);
      continue;
    }
    for (std::size_t begin = 0; begin < word.size();) {
      const std::size_t end = std::min(word.find(',', begin), word.size());
      if (end > begin) numbers.push_back(word.substr(begin, end - begin));
      begin = end + 1;
      if (numbers.size() > kMostNumbers) return {};
    }
    if (!numbers.empty() && !IsNumber(numbers.back())) return {};
  }
  for (const std::string& number : numbers) {
    if (!IsNumber(number) && !IsDecimalCommaNumber(number)) return {};
  }
  return numbers;
}

}  // namespace

NumberTable ReadNumberTable(const CameraDocument& document) {
  if (document.rows().size() > kMostRows) return {};
  NumberTable table;
  for (const TextRow& row : document.rows()) {
    if (row.words.size() > kMostNumbers) return {};
    std::vector<std::string> numbers = NumbersOfRow(row.words);
    if (numbers.empty()) return {};
    table.push_back({row.line, std::move(numbers)});
  }
  return table;
}

bool IsMatrixTable(const NumberTable& table) {
  if (table.size() == 1) {
    const std::vector<std::string>& words = table[0].words;
    const auto is = [&](std::size_t k, double wanted) { return NumberOf(words[k]) == wanted; };
    return words.size() == 9 && is(1, 0.0) && is(3, 0.0) && is(6, 0.0) && is(7, 0.0) && is(8, 1.0);
  }
  if (table.size() != 3 && table.size() != 4) return false;
  for (const TextRow& row : table) {
    if (row.words.size() != table[0].words.size()) return false;
  }
  return table[0].words.size() == 3 || table[0].words.size() == 4;
}

}  // namespace rotslam
