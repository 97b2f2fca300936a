#pragma once

#include <optional>
#include <sstream>
#include <string>

namespace rotslam {

// Words for the `Problem()` of options structs: the first field out of range by name, value and
// limit.

/// "max_distance is 300, must be 0 to 256".
template <class Value>
std::string OutOfRange(const char* name, const Value& value, const char* limit) {
  std::ostringstream text;
  text << name << " is " << value << ", must be " << limit;
  return text.str();
}

/// The problem of a nested options struct, its name in front: "matching.max_distance is ...".
template <class Options>
std::optional<std::string> ProblemIn(const char* name, const Options& options) {
  const std::optional<std::string> problem = options.Problem();
  if (!problem) return std::nullopt;
  return std::string(name) + "." + *problem;
}

}  // namespace rotslam
