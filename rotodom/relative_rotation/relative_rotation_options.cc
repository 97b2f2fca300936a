#include "rotodom/relative_rotation/relative_rotation_options.h"

#include "rotodom/types/options.h"

namespace rotslam {

std::optional<std::string> RelativeRotationOptions::Problem() const {
  if (!(inlier_px > 0.0)) return OutOfRange("inlier_px", inlier_px, "positive");
  if (!(loss_sigmas > 0.0)) return OutOfRange("loss_sigmas", loss_sigmas, "positive");
  if (!(min_noise_px > 0.0)) return OutOfRange("min_noise_px", min_noise_px, "positive");
  if (!(shared_error_px >= 0.0)) {
    return OutOfRange("shared_error_px", shared_error_px, "zero or more");
  }
  if (!(finest_px > 0.0)) return OutOfRange("finest_px", finest_px, "positive");
  if (min_samples < 0) return OutOfRange("min_samples", min_samples, "zero or more");
  if (sample_size < 5) return OutOfRange("sample_size", sample_size, "at least 5");
  if (!(confidence > 0.0 && confidence < 1.0)) {
    return "confidence = " + std::to_string(confidence) + ": must lie between 0 and 1";
  }
  if (max_samples < 1) return OutOfRange("max_samples", max_samples, "at least 1");
  if (refine_iterations < 1) {
    return OutOfRange("refine_iterations", refine_iterations, "at least 1");
  }
  if (min_inliers < 6) return OutOfRange("min_inliers", min_inliers, "at least 6");
  return ProblemIn("baseline", baseline);
}

}  // namespace rotslam
