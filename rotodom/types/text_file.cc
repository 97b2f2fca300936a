#include "rotodom/types/text_file.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <limits>
#include <sstream>
#include <stdexcept>
#include <string_view>
#include <system_error>

namespace rotslam {
namespace {

std::vector<std::string> SplitWords(std::string_view line) {
  constexpr std::string_view kSeparators = " \t\r,";
  std::vector<std::string> words;
  std::size_t begin = line.find_first_not_of(kSeparators);
  while (begin != std::string_view::npos) {
    const std::size_t end = std::min(line.find_first_of(kSeparators, begin), line.size());
    words.emplace_back(line.substr(begin, end - begin));
    begin = line.find_first_not_of(kSeparators, end);
  }
  return words;
}

std::ifstream Open(const std::filesystem::path& path) {
  std::error_code error;
  if (std::filesystem::is_directory(path, error)) {
    throw std::runtime_error(path.string() + ": is a folder, not a file");
  }
  std::ifstream file(path, std::ios::binary);
  if (!file) {
    throw std::runtime_error(path.string() + ": " + std::generic_category().message(errno));
  }
  return file;
}

TextRow CutAtCommas(const std::string& line, int number) {
  TextRow row{number, {""}};
  for (const char c : line) {
    if (c == ',') {
      row.words.emplace_back();
    } else if (c != '\r' && c != ' ') {
      row.words.back() += c;
    }
  }
  return row;
}

}  // namespace

std::string ReadBytes(const std::filesystem::path& path) {
  std::ifstream file = Open(path);
  std::string bytes;
  std::array<char, 65536> buffer;
  while (file.read(buffer.data(), buffer.size()) || file.gcount() > 0) {
    bytes.append(buffer.data(), static_cast<std::size_t>(file.gcount()));
  }
  if (file.bad()) throw std::runtime_error(path.string() + ": reading stopped half way");
  return bytes;
}

std::string ReadText(const std::filesystem::path& path) {
  const std::string bytes = ReadBytes(path);
  if (bytes.starts_with("\xff\xfe") || bytes.starts_with("\xfe\xff")) {
    throw std::runtime_error(path.string() + ": is UTF-16; save it as UTF-8");
  }
  if (bytes.find('\0') != std::string::npos) {
    throw std::runtime_error(path.string() + ": is not a text file");
  }
  std::string text;
  text.reserve(bytes.size());
  for (std::size_t k = bytes.starts_with("\xef\xbb\xbf") ? 3 : 0; k < bytes.size(); ++k) {
    if (bytes[k] != '\r') {
      text += bytes[k];
    } else if (k + 1 == bytes.size() || bytes[k + 1] != '\n') {
      text += '\n';
    }
  }
  return text;
}

std::vector<TextRow> ReadTextRows(const std::filesystem::path& path) {
  std::istringstream file(ReadText(path));
  std::vector<TextRow> rows;
  std::string line;
  for (int number = 1; std::getline(file, line); ++number) {
    std::vector<std::string> words = SplitWords(line);
    if (words.empty() || words.front().front() == '#') continue;
    rows.push_back({number, std::move(words)});
  }
  return rows;
}

std::vector<TextRow> ReadCsvRows(const std::filesystem::path& path, std::size_t num_columns) {
  std::istringstream file(ReadText(path));
  std::vector<TextRow> rows;
  std::string line;
  std::getline(file, line);  // the columns' names
  for (int number = 2; std::getline(file, line); ++number) {
    if (line.empty() || line == "\r") continue;
    rows.push_back(CutAtCommas(line, number));
    if (rows.back().words.size() == num_columns) continue;
    throw std::runtime_error(AtLine(path,
                                    number,
                                    "expected " + std::to_string(num_columns) + " columns, found " +
                                        std::to_string(rows.back().words.size())));
  }
  return rows;
}

std::string AtLine(const std::filesystem::path& path, int line, const std::string& reason) {
  std::string text = path.string() + ":" + std::to_string(line) + ": " + reason;
  std::replace(text.begin(), text.end(), '\n', ' ');  // which a word of a YAML file may hold
  return text;
}

double NumberAt(const std::filesystem::path& path, const TextRow& row, std::size_t position) {
  if (position >= row.words.size()) {
    throw std::runtime_error(AtLine(path, row.line, "the line ends too early"));
  }
  const std::string& word = row.words[position];
  const char* begin = word.data() + (word.starts_with('+') ? 1 : 0);
  const char* end = word.data() + word.size();
  double value = 0.0;
  const auto [stop, code] = std::from_chars(begin, end, value);
  if (code != std::errc() || stop != end || !std::isfinite(value)) {
    throw std::runtime_error(
        AtLine(path, row.line, "expected a finite number, found \"" + word + "\""));
  }
  return value;
}

int IntegerAt(const std::filesystem::path& path,
              const TextRow& row,
              std::size_t position,
              int low) {
  const double value = NumberAt(path, row, position);
  if (value != std::floor(value) || value < low || value > std::numeric_limits<int>::max()) {
    throw std::runtime_error(AtLine(path,
                                    row.line,
                                    "expected a whole number from " + std::to_string(low) +
                                        " on, found \"" + row.words[position] + "\""));
  }
  return static_cast<int>(value);
}

std::string FormatNumber(const char* format, double value) {
  std::array<char, 400> buffer;  // the longest double in %f has 309 digits before its point
  // Adding zero turns -0 into 0.
  const int length = std::snprintf(buffer.data(), buffer.size(), format, value + 0.0);
  return std::string(buffer.data(), static_cast<std::size_t>(length));
}

}  // namespace rotslam
