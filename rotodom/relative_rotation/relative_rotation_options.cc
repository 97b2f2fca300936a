#include "rotodom/relative_rotation/relative_rotation_options.h"

#include "rotodom/types/options.h"

namespace rotslam {

std::optional<std::string> RelativeRotationOptions::Problem() const {
  if (!(inlier_px > 0.0)) return OutOfRange("inlier_px", inlier_px, "positive");
  if (!(shared_error_px >= 0.0)) {
    return OutOfRange("shared_error_px", shared_error_px, "zero or more");
  }
  if (max_samples < 1) return OutOfRange("max_samples", max_samples, "at least 1");
  if (min_inliers < 6) return OutOfRange("min_inliers", min_inliers, "at least 6");
  return ProblemIn("baseline", baseline);
}

}  // namespace rotslam
