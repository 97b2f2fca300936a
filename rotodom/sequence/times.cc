#include "rotodom/sequence/times.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <system_error>

#include "rotodom/sequence/layout.h"
#include "rotodom/types/text_file.h"

namespace rotslam {
namespace {

bool IsDigit(char c) { return c >= '0' && c <= '9'; }

// Seconds of one decimal number with a point, such as 1000.033333.
std::optional<double> SecondsWithPoint(const std::string& stem) {
  const std::size_t point = stem.find('.');
  if (point == std::string::npos) return std::nullopt;
  if (!AllDigits(stem.substr(0, point)) || !AllDigits(stem.substr(point + 1))) return std::nullopt;
  return ParseSeconds(stem);
}

// Seconds of a count of ticks since 1970, if that is a date from 2000 to 2099.
std::optional<double> SecondsSince1970(const std::string& stem, std::int64_t ticks_per_second) {
  constexpr std::int64_t kYear2000 = 946'684'800;
  constexpr std::int64_t kYear2100 = 4'102'444'800;
  const auto ticks = AllDigits(stem) ? ParseInteger(stem) : std::nullopt;
  if (!ticks || *ticks / ticks_per_second < kYear2000 || *ticks / ticks_per_second >= kYear2100) {
    return std::nullopt;
  }
  return SecondsFromTicks(*ticks, ticks_per_second);
}

}  // namespace

bool AllDigits(std::string_view text) {
  return !text.empty() && std::all_of(text.begin(), text.end(), IsDigit);
}

std::optional<double> ParseSeconds(std::string_view text) {
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value)) {
    return std::nullopt;
  }
  return value;
}

std::optional<std::int64_t> ParseInteger(std::string_view text) {
  std::int64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

double SecondsFromTicks(std::int64_t ticks, std::int64_t ticks_per_second) {
  const std::int64_t seconds = ticks / ticks_per_second;
  const std::int64_t rest = ticks % ticks_per_second;
  return static_cast<double>(seconds) +
         static_cast<double>(rest) / static_cast<double>(ticks_per_second);
}

std::vector<double> TimesOf(const std::filesystem::path& list,
                            const std::vector<TextLine>& lines,
                            const std::string& expected) {
  std::vector<std::string> words;
  words.reserve(lines.size());
  for (const TextLine& line : lines) {
    words.push_back(line.text.substr(0, line.text.find_first_of(" \t")));
  }
  if (auto times_s = TimestampsFromNames(words); times_s && !words.empty()) return *times_s;
  std::vector<double> times_s;
  times_s.reserve(lines.size());
  for (std::size_t k = 0; k < lines.size(); ++k) {
    const auto time_s = ParseSeconds(words[k]);
    if (!time_s) FailAtLine(list, lines[k], expected);
    times_s.push_back(*time_s);
  }
  return times_s;
}

std::string MadeUpTimes(double fps) {
  return "made up at " + FormatNumber("%.6g", fps) + " frames a second";
}

bool NaturalLess(const std::string& a, const std::string& b) {
  std::size_t i = 0;
  std::size_t j = 0;
  while (i < a.size() && j < b.size()) {
    if (!IsDigit(a[i]) || !IsDigit(b[j])) {
      if (a[i] != b[j]) return a[i] < b[j];
      ++i;
      ++j;
      continue;
    }
    const auto run = [](const std::string& text, std::size_t& from) {
      while (from < text.size() && text[from] == '0') ++from;
      const std::size_t begin = from;
      while (from < text.size() && IsDigit(text[from])) ++from;
      return std::string_view(text).substr(begin, from - begin);
    };
    const std::string_view number_a = run(a, i);
    const std::string_view number_b = run(b, j);
    if (number_a.size() != number_b.size()) return number_a.size() < number_b.size();
    if (number_a != number_b) return number_a < number_b;
  }
  const std::size_t rest_a = a.size() - i;
  const std::size_t rest_b = b.size() - j;
  if (rest_a != rest_b) return rest_a < rest_b;
  return a < b;  // equal but for leading zeros
}

std::optional<std::vector<double>> TimestampsFromNames(const std::vector<std::string>& stems) {
  const auto read_all = [&](const auto& read) -> std::optional<std::vector<double>> {
    std::vector<double> times_s;
    for (const std::string& stem : stems) {
      const std::optional<double> time = read(stem);
      if (!time) return std::nullopt;
      times_s.push_back(*time);
    }
    return times_s;
  };
  if (auto times_s = read_all(SecondsWithPoint)) return times_s;
  for (const std::int64_t ticks_per_second : {1'000LL, 1'000'000LL, 1'000'000'000LL}) {
    const auto read = [&](const std::string& stem) {
      return SecondsSince1970(stem, ticks_per_second);
    };
    if (auto times_s = read_all(read)) return times_s;
  }
  return std::nullopt;
}

}  // namespace rotslam
