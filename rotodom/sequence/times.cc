#include "rotodom/sequence/times.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <cmath>
#include <system_error>
#include <utility>

#include "rotodom/types/text_file.h"

namespace rotslam {
namespace {

constexpr std::array<std::int64_t, 4> kTicksPerSecond = {1, 1'000, 1'000'000, 1'000'000'000};

bool IsDigitOfTime(char c) { return c >= '0' && c <= '9'; }

std::string UnitName(std::int64_t ticks_per_second) {
  switch (ticks_per_second) {
    case 1'000:
      return "ms";
    case 1'000'000:
      return "us";
    case 1'000'000'000:
      return "ns";
    default:
      return "seconds";
  }
}

// Is it a date from 2000 to 2099?
bool IsDate(double seconds) {
  constexpr double kYear2000 = 946'684'800;
  constexpr double kYear2100 = 4'102'444'800;
  return seconds >= kYear2000 && seconds < kYear2100;
}

// Median distance of neighbours that differ; 0 without any.
double MedianStep(const std::vector<double>& values) {
  std::vector<double> steps;
  for (std::size_t k = 1; k < values.size(); ++k) {
    if (values[k] != values[k - 1]) steps.push_back(std::abs(values[k] - values[k - 1]));
  }
  if (steps.empty()) return 0.0;
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  return *middle;
}

// The unit in which all values are dates; 0: none. Nanoseconds since a camera was switched on may
// look like dates in milliseconds or microseconds, but frames would be far apart.
std::int64_t TicksOfDates(const std::vector<double>& values) {
  constexpr std::array<double, 4> kMostSecondsApart = {600.0, 600.0, 10.0, 1e9};  // by the unit
  const double step = MedianStep(values);
  for (std::size_t k = 0; k < kTicksPerSecond.size(); ++k) {
    const auto scale = static_cast<double>(kTicksPerSecond[k]);
    const auto is_date = [&](double value) { return IsDate(value / scale); };
    if (!values.empty() && step / scale < kMostSecondsApart[k] &&
        std::all_of(values.begin(), values.end(), is_date)) {
      return kTicksPerSecond[k];
    }
  }
  return 0;
}

// The unit in which `step` is one of frames: 1000 to 1 a second. 0: it is too small to tell.
std::int64_t TicksOfStep(double step, bool is_whole) {
  // Frames may be numbered with a stride; fractions are seconds, also of a slow time lapse.
  constexpr double kLeastWholeStep = 8.0;
  constexpr double kMostSeconds = 10.0;
  if (step < (is_whole ? kLeastWholeStep : kMostSeconds)) return is_whole ? 0 : 1;
  if (step < 1e3) return 1'000;
  return step < 1e6 ? 1'000'000 : 1'000'000'000;
}

// Days from 1970-01-01 to a date.
std::optional<std::int64_t> DaysSince1970(int year, int month, int day) {
  const std::chrono::year_month_day date{std::chrono::year(year),
                                         std::chrono::month(static_cast<unsigned>(month)),
                                         std::chrono::day(static_cast<unsigned>(day))};
  if (!date.ok()) return std::nullopt;
  return std::chrono::sys_days(date).time_since_epoch().count();
}

// The number that `count` digits at `at` are.
int DigitsAt(std::string_view text, std::size_t at, std::size_t count) {
  int value = 0;
  for (const char c : text.substr(at, count)) value = 10 * value + (c - '0');
  return value;
}

// ---- Names

// A name cut into runs of digits and what lies between them: texts[0] digits[0] texts[1] ...
struct NameParts {
  std::vector<std::string> texts;
  std::vector<std::string> digits;
};

NameParts CutName(std::string_view name) {
  NameParts parts;
  std::size_t at = 0;
  while (true) {
    const auto begin = std::find_if(name.begin() + at, name.end(), IsDigitOfTime);
    parts.texts.emplace_back(name.begin() + at, begin);
    if (begin == name.end()) return parts;
    const auto end = std::find_if_not(begin, name.end(), IsDigitOfTime);
    parts.digits.emplace_back(begin, end);
    at = static_cast<std::size_t>(end - name.begin());
  }
}

// One run of digits of all names.
using DigitColumn = std::vector<std::string>;

// Dates beside numbers that are far from being some: not all are written in the same way.
bool HoldsSomeDates(const std::vector<double>& values) {
  constexpr double kFar = 100.0;
  const auto [least, most] = std::minmax_element(values.begin(), values.end());
  return values.size() > 1 && *most > kFar * *least && TicksOfDates({*most}) > 1;
}

std::optional<SpokenTimes> TimesOfTicks(const DigitColumn& column) {
  std::vector<std::int64_t> ticks;
  std::vector<double> values;
  for (const std::string& digits : column) {
    const auto value = ParseInteger(digits);
    if (!value) return std::nullopt;
    ticks.push_back(*value);
    values.push_back(static_cast<double>(*value));
  }
  std::int64_t unit = TicksOfDates(values);
  if (unit == 1) return std::nullopt;  // ten digits could be anything
  std::string name = UnitName(unit) + " since 1970";
  if (unit == 0) {
    if (HoldsSomeDates(values)) return std::nullopt;
    // Numbers of frames step by little, hardly ever by as much as 1000.
    constexpr double kLeastStep = 1000.0;
    const double step = MedianStep(values);
    if (step <= kLeastStep) return std::nullopt;
    unit = TicksOfStep(step, true);
    name = UnitName(unit);
  }
  SpokenTimes times{{}, std::move(name)};
  for (const std::int64_t value : ticks) times.times_s.push_back(SecondsFromTicks(value, unit));
  return times;
}

// How far the steps of sorted times differ from their median, as a share of it.
double Unevenness(std::vector<double> times_s) {
  std::sort(times_s.begin(), times_s.end());
  const double step = MedianStep(times_s);
  if (step == 0.0) return 0.0;
  double sum = 0.0;
  for (std::size_t k = 1; k < times_s.size(); ++k) {
    sum += std::min(10.0, std::abs(times_s[k] - times_s[k - 1] - step) / step);
  }
  return sum / static_cast<double>(times_s.size());
}

// Seconds and a count of nanoseconds (of microseconds where `digits` is 6).
std::optional<std::vector<double>> TimesOfCounts(const DigitColumn& seconds,
                                                 const DigitColumn& counts,
                                                 std::size_t digits) {
  std::vector<double> times_s;
  for (std::size_t k = 0; k < seconds.size(); ++k) {
    const auto whole = ParseInteger(seconds[k]);
    const auto count = ParseInteger(counts[k]);
    if (!whole || !count || counts[k].size() > digits) return std::nullopt;
    times_s.push_back(static_cast<double>(*whole) +
                      static_cast<double>(*count) / std::pow(10.0, static_cast<double>(digits)));
  }
  return times_s;
}

std::size_t LongestOf(const DigitColumn& column) {
  std::size_t longest = 0;
  for (const std::string& digits : column) longest = std::max(longest, digits.size());
  return longest;
}

// `sec.nsec` as ROS prints it, without leading zeros: no fraction has one, the longest are of nine
// digits, and the times are more even than as decimal numbers.
bool LacksLeadingZeros(const DigitColumn& fractions,
                       const std::vector<double>& as_counts,
                       const std::vector<double>& as_decimals) {
  const auto is_short = [](const std::string& digits) { return digits.size() < 9; };
  const auto is_padded = [](const std::string& digits) {
    return digits.size() > 1 && digits.size() < 9 && digits.front() == '0';
  };
  return LongestOf(fractions) == 9 && std::any_of(fractions.begin(), fractions.end(), is_short) &&
         std::none_of(fractions.begin(), fractions.end(), is_padded) &&
         Unevenness(as_counts) < Unevenness(as_decimals);
}

std::optional<SpokenTimes> TimesWithPoint(const DigitColumn& seconds,
                                          const DigitColumn& fractions) {
  SpokenTimes times{{}, "seconds"};
  for (std::size_t k = 0; k < seconds.size(); ++k) {
    const auto time_s = ParseNumber(seconds[k] + "." + fractions[k]);
    if (!time_s) return std::nullopt;
    times.times_s.push_back(*time_s);
  }
  const auto as_counts = TimesOfCounts(seconds, fractions, 9);
  if (as_counts && LacksLeadingZeros(fractions, *as_counts, times.times_s)) {
    return SpokenTimes{*as_counts, "seconds.nanoseconds"};
  }
  // Numbers with a point that are no times: 1.9, 1.10; 0000.000123.
  constexpr double kLeastStepS = 1e-4;
  std::vector<double> sorted = times.times_s;
  std::sort(sorted.begin(), sorted.end());
  const bool has_twins = std::adjacent_find(sorted.begin(), sorted.end()) != sorted.end();
  if (has_twins || (sorted.size() > 1 && MedianStep(sorted) < kLeastStepS)) return std::nullopt;
  return times;
}

// Then the first may number the frames, and the second is a time that never begins anew.
bool BothIncrease(const DigitColumn& seconds, const DigitColumn& counts) {
  bool both = seconds.size() > 1;
  for (std::size_t k = 1; k < seconds.size(); ++k) {
    both = both && ParseInteger(seconds[k]) > ParseInteger(seconds[k - 1]) &&
           ParseInteger(counts[k]) > ParseInteger(counts[k - 1]);
  }
  return both;
}

std::optional<SpokenTimes> TimesOfPair(const DigitColumn& seconds, const DigitColumn& counts) {
  std::vector<double> values;
  for (const std::string& digits : seconds) {
    values.push_back(static_cast<double>(ParseInteger(digits).value_or(-1)));
  }
  const std::size_t longest = LongestOf(counts);
  // Without a date the second number must be of a size that numbers of frames do not have.
  const bool is_date = TicksOfDates(values) == 1;
  if (!is_date && (longest < 8 || BothIncrease(seconds, counts))) return std::nullopt;
  const std::size_t digits = longest > 6 ? 9 : 6;
  const auto times_s = TimesOfCounts(seconds, counts, digits);
  if (!times_s) return std::nullopt;
  return SpokenTimes{*times_s, digits == 9 ? "seconds_nanoseconds" : "seconds_microseconds"};
}

// `20260115_063000123`: date, hours, minutes, seconds and their fraction, as phones name pictures.
std::optional<SpokenTimes> TimesOfClock(const DigitColumn& dates, const DigitColumn& clocks) {
  SpokenTimes times{{}, "date and time of day"};
  for (std::size_t k = 0; k < dates.size(); ++k) {
    if (dates[k].size() != 8 || clocks[k].size() < 6 || clocks[k].size() > 15) return std::nullopt;
    const auto days =
        DaysSince1970(DigitsAt(dates[k], 0, 4), DigitsAt(dates[k], 4, 2), DigitsAt(dates[k], 6, 2));
    const int hours = DigitsAt(clocks[k], 0, 2);
    const int minutes = DigitsAt(clocks[k], 2, 2);
    const int seconds = DigitsAt(clocks[k], 4, 2);
    if (!days || hours > 23 || minutes > 59 || seconds > 60) return std::nullopt;
    const double whole_s =
        static_cast<double>(*days * 86'400 + hours * 3'600 + minutes * 60 + seconds);
    if (!IsDate(whole_s)) return std::nullopt;
    times.times_s.push_back(whole_s + ParseNumber("0." + clocks[k].substr(6)).value_or(0.0));
  }
  std::vector<double> sorted = times.times_s;
  std::sort(sorted.begin(), sorted.end());
  // Several pictures of one second, where the names stop at seconds.
  if (std::adjacent_find(sorted.begin(), sorted.end()) != sorted.end()) return std::nullopt;
  return times;
}

}  // namespace

bool AllDigits(std::string_view text) {
  return !text.empty() && std::all_of(text.begin(), text.end(), IsDigitOfTime);
}

std::optional<std::int64_t> ParseInteger(std::string_view text) {
  std::int64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

std::optional<double> ParseNumber(std::string_view text) {
  std::string with_point(text);
  if (std::count(text.begin(), text.end(), ',') == 1 && text.find('.') == std::string_view::npos) {
    std::replace(with_point.begin(), with_point.end(), ',', '.');
  }
  const char* begin = with_point.data() + (with_point.starts_with('+') ? 1 : 0);
  const char* end = with_point.data() + with_point.size();
  double value = 0.0;
  const auto [stop, error] = std::from_chars(begin, end, value);
  if (error != std::errc() || stop != end || !std::isfinite(value)) return std::nullopt;
  return value;
}

std::optional<double> ParseDate(std::string_view text) {
  // A letter stands for any digit.
  constexpr std::string_view kShape = "dddd-dd-dd dd:dd:dd";
  if (text.size() < kShape.size()) return std::nullopt;
  for (std::size_t k = 0; k < kShape.size(); ++k) {
    const bool fits = kShape[k] == 'd'   ? IsDigitOfTime(text[k])
                      : kShape[k] == ' ' ? text[k] == ' ' || text[k] == 'T'
                                         : text[k] == kShape[k];
    if (!fits) return std::nullopt;
  }
  std::string_view rest = text.substr(kShape.size());
  if (rest.ends_with('Z')) rest.remove_suffix(1);
  double fraction_s = 0.0;
  if (!rest.empty()) {
    if (rest.front() != '.' || !AllDigits(rest.substr(1))) return std::nullopt;
    fraction_s = ParseNumber("0" + std::string(rest)).value_or(0.0);
  }
  const auto days = DaysSince1970(DigitsAt(text, 0, 4), DigitsAt(text, 5, 2), DigitsAt(text, 8, 2));
  const int hours = DigitsAt(text, 11, 2);
  const int minutes = DigitsAt(text, 14, 2);
  const int seconds = DigitsAt(text, 17, 2);
  if (!days || hours > 23 || minutes > 59 || seconds > 60) return std::nullopt;
  return static_cast<double>(*days * 86'400 + hours * 3'600 + minutes * 60 + seconds) + fraction_s;
}

double SecondsFromTicks(std::int64_t ticks, std::int64_t ticks_per_second) {
  const std::int64_t seconds = ticks / ticks_per_second;
  const std::int64_t rest = ticks % ticks_per_second;
  return static_cast<double>(seconds) +
         static_cast<double>(rest) / static_cast<double>(ticks_per_second);
}

std::int64_t TicksOfTitle(std::string_view title) {
  std::string lower(title);
  std::transform(lower.begin(), lower.end(), lower.begin(), [](unsigned char c) {
    return static_cast<char>(c >= 'A' && c <= 'Z' ? c - 'A' + 'a' : c);
  });
  const auto names = [&](std::string_view unit, std::string_view word) {
    const std::string text(unit);
    return lower.find("[" + text + "]") != std::string::npos ||
           lower.find("(" + text + ")") != std::string::npos || lower.ends_with("_" + text) ||
           lower.find(word) != std::string::npos;
  };
  if (names("ns", "nanosec") || lower.ends_with("nsec") || lower.ends_with("nsecs")) {
    return 1'000'000'000;
  }
  if (names("us", "microsec")) return 1'000'000;
  if (names("ms", "millisec")) return 1'000;
  if (names("s", "second") || names("sec", "second")) return 1;
  return 0;
}

std::optional<SpokenTimes> TimesOfWords(const std::vector<std::string>& words,
                                        UnclearTimes unclear,
                                        std::int64_t ticks_per_second) {
  SpokenTimes times;
  if (!words.empty() && ParseDate(words.front())) {
    times.unit = "dates";
    for (const std::string& word : words) {
      const auto time_s = ParseDate(word);
      if (!time_s) return std::nullopt;
      times.times_s.push_back(*time_s);
    }
    return times;
  }
  std::vector<std::int64_t> ticks;  // as long as all are whole
  std::vector<double> values;
  for (const std::string& word : words) {
    const auto value = ParseNumber(word);
    if (!value) return std::nullopt;
    values.push_back(*value);
    if (const auto whole = ParseInteger(word)) ticks.push_back(*whole);
  }
  const bool is_whole = ticks.size() == values.size();
  std::int64_t unit = ticks_per_second;
  const std::int64_t unit_of_dates = TicksOfDates(values);
  if (unit == 0) unit = unit_of_dates;
  if (unit == 0) unit = TicksOfStep(MedianStep(values), is_whole);
  if (unit == 0) {
    if (unclear == UnclearTimes::kAreNone) return std::nullopt;
    unit = 1;
  }
  times.unit = UnitName(unit) + (unit_of_dates == unit && unit > 1 ? " since 1970" : "");
  for (std::size_t k = 0; k < values.size(); ++k) {
    times.times_s.push_back(is_whole ? SecondsFromTicks(ticks[k], unit)
                                     : values[k] / static_cast<double>(unit));
  }
  return times;
}

std::optional<SpokenTimes> TimesOfNames(const std::vector<std::string>& stems) {
  if (stems.empty()) return std::nullopt;
  std::vector<NameParts> names;
  names.reserve(stems.size());
  for (const std::string& stem : stems) names.push_back(CutName(stem));
  const std::vector<std::string>& texts = names.front().texts;
  for (const NameParts& name : names) {
    if (name.texts != texts) return std::nullopt;
  }
  const std::size_t num_columns = texts.size() - 1;
  std::vector<DigitColumn> columns(num_columns);
  std::vector<bool> varies(num_columns, false);
  for (std::size_t c = 0; c < num_columns; ++c) {
    for (const NameParts& name : names) {
      columns[c].push_back(name.digits[c]);
      varies[c] = varies[c] || name.digits[c] != columns[c].front();
    }
  }
  const bool is_one = stems.size() == 1;
  const auto between = [&](std::size_t c) { return c < num_columns ? texts[c + 1] : ""; };
  // Of one name nothing tells which digits would vary: it is the time and nothing else.
  const bool is_bare = texts.front().empty() && texts.back().empty();
  for (std::size_t c = 0; c < num_columns; ++c) {
    const bool has_next = c + 1 < num_columns;
    const bool has_point = has_next && between(c) == "." &&
                           !(c + 2 < num_columns && between(c + 1) == ".") &&
                           !(c > 0 && between(c - 1) == ".");
    if (has_point && (is_one ? is_bare && num_columns == 2 : varies[c] || varies[c + 1])) {
      return TimesWithPoint(columns[c], columns[c + 1]);
    }
  }
  for (std::size_t c = 0; c + 1 < num_columns; ++c) {
    if (between(c) != "_" && between(c) != "-") continue;
    if (auto times = TimesOfClock(columns[c], columns[c + 1])) return times;
    if (is_one ? !is_bare || num_columns != 2 : !varies[c + 1]) continue;
    if (auto times = TimesOfPair(columns[c], columns[c + 1])) return times;
  }
  std::optional<SpokenTimes> found;
  for (std::size_t c = 0; c < num_columns; ++c) {
    if (is_one ? !is_bare || num_columns != 1 : !varies[c]) continue;
    const bool is_fraction = (c > 0 && between(c - 1) == ".") || between(c) == ".";
    auto times = is_fraction ? std::nullopt : TimesOfTicks(columns[c]);
    if (!times) continue;
    if (found) return std::nullopt;  // two of them
    found = std::move(times);
  }
  return found;
}

std::string MadeUpTimes(double fps) {
  return "made up at " + FormatNumber("%.6g", fps) + " frames a second (--fps sets the rate)";
}

}  // namespace rotslam
