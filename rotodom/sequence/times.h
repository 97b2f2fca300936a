#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rotodom/sequence/image_list.h"

namespace rotslam {

bool AllDigits(std::string_view text);
std::optional<std::int64_t> ParseInteger(std::string_view text);

/// A finite number and nothing else.
std::optional<double> ParseSeconds(std::string_view text);

/// ticks / ticks_per_second, without losing a digit before the division.
double SecondsFromTicks(std::int64_t ticks, std::int64_t ticks_per_second);

/// What Layout::times_source says of times that are made up: "made up at 30 frames a second".
std::string MadeUpTimes(double fps);

/// The times of a list, the first word of each line: seconds, or where all of them say so as file
/// names do, ms, us or ns since 1970.
std::vector<double> TimesOf(const std::filesystem::path& list,
                            const std::vector<TextLine>& lines,
                            const std::string& expected);

}  // namespace rotslam
