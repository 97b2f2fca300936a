#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace rotslam {

/// Times of frames, as a list or the names of files tell them.
struct SpokenTimes {
  std::vector<double> times_s;
  std::string unit;  // "seconds", "ns since 1970", "ms", "dates"
};

bool AllDigits(std::string_view text);

/// A whole number and nothing else; nullopt also where it has more than 63 bits.
std::optional<std::int64_t> ParseInteger(std::string_view text);

/// A finite number and nothing else; a comma may stand for the decimal point.
std::optional<double> ParseNumber(std::string_view text);

/// Seconds since 1970 of "2011-09-26 13:02:25.964389445", with a blank or a T between date and
/// time.
std::optional<double> ParseDate(std::string_view text);

/// ticks / ticks_per_second, without losing a digit before the division.
double SecondsFromTicks(std::int64_t ticks, std::int64_t ticks_per_second);

/// The unit that the title of a column names: 1, 1e3, 1e6 or 1e9 ticks a second; 0 where it names
/// none. "timestamp [ns]", "t_us".
std::int64_t TicksOfTitle(std::string_view title);

/// The meaning of whole numbers that step by a few and whose unit nothing tells: no times, or s.
enum class UnclearTimes { kAreNone, kAreSeconds };

/// The times of a column of a list: numbers or dates. The unit of numbers is `ticks_per_second`
/// when that is not 0, else what makes them dates from 2000 to 2099, else what makes the median
/// step between them a frame rate that cameras have: whole numbers that step by 33 count
/// milliseconds, by 33333 microseconds, and so on.
/// @return  nullopt where a word is no time or, for kAreNone, the numbers are those of frames.
std::optional<SpokenTimes> TimesOfWords(const std::vector<std::string>& words,
                                        UnclearTimes unclear,
                                        std::int64_t ticks_per_second = 0);

/// The times that file names (without extension) tell, if all of them tell one in the same way,
/// with the same text around it: seconds with a decimal point; ms, us or ns since 1970 of a date
/// from 2000 to 2099; us or ns since a camera was switched on; seconds and nanoseconds, `sec_nsec`
/// or `sec.nsec`, whose nanoseconds may lack leading zeros; `20260115_063000123`.
std::optional<SpokenTimes> TimesOfNames(const std::vector<std::string>& stems);

/// The text of Layout::times_source for times that follow from a rate alone.
std::string MadeUpTimes(double fps);

}  // namespace rotslam
