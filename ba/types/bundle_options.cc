#include "ba/types/bundle_options.h"

#include "rotodom/types/options.h"

namespace rotslam {
std::optional<std::string> BundleRound::Problem() const {
  if (!(max_error_px >= 0.0)) return OutOfRange("max_error_px", max_error_px, "at least 0");
  if (!(max_residual >= 0.0)) return OutOfRange("max_residual", max_residual, "at least 0");
  if (!(loss_scale > 0.0)) return OutOfRange("loss_scale", loss_scale, "positive");
  if (max_iterations < 1) return OutOfRange("max_iterations", max_iterations, "at least 1");
  if (!(function_tolerance >= 0.0)) {
    return OutOfRange("function_tolerance", function_tolerance, "at least 0");
  }
  return std::nullopt;
}

std::optional<std::string> LensOptions::Problem() const {
  if (!(focal_sigma > 0.0)) return OutOfRange("focal_sigma", focal_sigma, "positive");
  if (!(principal_sigma > 0.0)) return OutOfRange("principal_sigma", principal_sigma, "positive");
  if (!(distortion_sigma > 0.0)) {
    return OutOfRange("distortion_sigma", distortion_sigma, "positive");
  }
  if (!(min_gain >= 0.0)) return OutOfRange("min_gain", min_gain, "at least 0");
  return std::nullopt;
}

std::optional<std::string> BundleOptions::Problem() const {
  if (auto problem = ProblemIn("fixed_rotation", fixed_rotation)) return problem;
  if (auto problem = ProblemIn("coarse", coarse)) return problem;
  if (auto problem = ProblemIn("fine", fine)) return problem;
  if (auto problem = ProblemIn("lens", lens)) return problem;
  if (!fixed_rotation.enabled && !coarse.enabled && !fine.enabled) {
    return "fine.enabled is false, must be true for one of fixed_rotation, coarse and fine";
  }
  if (preparing_observations < 0) {
    return OutOfRange("preparing_observations", preparing_observations, "at least 0");
  }
  if (!(loss_spreads >= 0.0)) return OutOfRange("loss_spreads", loss_spreads, "at least 0");
  if (!(limit_spreads >= 0.0)) return OutOfRange("limit_spreads", limit_spreads, "at least 0");
  if (!(blur_s_per_px >= 0.0)) return OutOfRange("blur_s_per_px", blur_s_per_px, "at least 0");
  if (max_final_rounds < 1) {
    return OutOfRange("max_final_rounds", max_final_rounds, "at least 1");
  }
  if (!(min_angle_deg > 0.0 && min_angle_deg < 90.0)) {
    return OutOfRange("min_angle_deg", min_angle_deg, "above 0 and below 90");
  }
  if (max_dense_frames < 0) return OutOfRange("max_dense_frames", max_dense_frames, "at least 0");
  if (num_threads < 1) return OutOfRange("num_threads", num_threads, "at least 1");
  return std::nullopt;
}

}  // namespace rotslam
