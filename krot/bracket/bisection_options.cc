#include "krot/bracket/bisection_options.h"

#include "rotodom/types/options.h"

namespace rotslam {

std::optional<std::string> BisectionOptions::Problem() const {
  if (method != "interior" && method != "programs") {
    return "method is '" + method + "', must be interior or programs";
  }
  if (!(relative_gap > 0.0)) {
    return OutOfRange("relative_gap", relative_gap, "above 0");
  }
  if (!(zero_gamma > 0.0)) {
    return OutOfRange("zero_gamma", zero_gamma, "above 0");
  }
  if (max_programs < 1) {
    return OutOfRange("max_programs", max_programs, "at least 1");
  }
  if (!(max_extent > 1.0)) {
    return OutOfRange("max_extent", max_extent, "above 1");
  }
  if (points_per_view < 4) {
    return OutOfRange("points_per_view", points_per_view, "at least 4");
  }
  if (added_per_view < 1) {
    return OutOfRange("added_per_view", added_per_view, "at least 1");
  }
  return std::nullopt;
}

}  // namespace rotslam
