#include "krot/bracket/bisection_options.h"

#include "rotodom/types/options.h"

namespace rotslam {

std::optional<std::string> BisectionOptions::Problem() const {
  if (!(relative_gap > 0.0)) {
    return OutOfRange("relative_gap", relative_gap, "above 0");
  }
  if (max_programs < 1) {
    return OutOfRange("max_programs", max_programs, "at least 1");
  }
  return std::nullopt;
}

}  // namespace rotslam
