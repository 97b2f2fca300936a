#include "ba/types/bundle_options.h"

#include <algorithm>

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

LensParameters LensOptions::Sigmas(CameraModel model) const {
  constexpr int kNumFirst = 2;
  if (given_sigmas) return *given_sigmas;
  LensParameters sigmas = LensParameters::Zero();
  if (refine_focal) sigmas[kLensFocal] = focal_sigma;
  if (refine_principal_point) sigmas.segment<2>(kLensCenter).setConstant(principal_sigma);
  const int num_coefficients = NumLensCoefficients(model);
  const int num_first = std::min(kNumFirst, num_coefficients);
  if (refine_distortion) {
    sigmas.segment(kLensDistortion, num_first).setConstant(distortion_sigma);
  }
  if (refine_higher_terms) {
    sigmas.segment(kLensDistortion + num_first, num_coefficients - num_first)
        .setConstant(distortion_sigma);
    if (HasTangential(model)) sigmas.segment<2>(kLensTangential) *= tangential_share;
  }
  return sigmas;
}

int LensOptions::NumBlocks() const {
  if (given_sigmas) {
    if (given_sigmas->isZero()) return 0;
    return given_sigmas->tail<kLensBlockSize>().isZero() ? 1 : kLensSize / kLensBlockSize;
  }
  if (refine_higher_terms) return kLensSize / kLensBlockSize;
  return refine_distortion || refine_focal || refine_principal_point ? 1 : 0;
}

std::optional<std::string> LensOptions::Problem() const {
  if (!(focal_sigma > 0.0)) return OutOfRange("focal_sigma", focal_sigma, "positive");
  if (!(principal_sigma > 0.0)) return OutOfRange("principal_sigma", principal_sigma, "positive");
  if (!(distortion_sigma > 0.0)) {
    return OutOfRange("distortion_sigma", distortion_sigma, "positive");
  }
  if (given_sigmas && !(given_sigmas->array() >= 0.0).all()) {
    return "given_sigmas has negative ones";
  }
  if (!(min_gain >= 0.0)) return OutOfRange("min_gain", min_gain, "at least 0");
  if (!(min_tangential_gain >= 0.0)) {
    return OutOfRange("min_tangential_gain", min_tangential_gain, "at least 0");
  }
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
  if (max_final_rounds < 0) {
    return OutOfRange("max_final_rounds", max_final_rounds, "at least 0");
  }
  if (!(min_angle_deg > 0.0 && min_angle_deg < 90.0)) {
    return OutOfRange("min_angle_deg", min_angle_deg, "above 0 and below 90");
  }
  if (min_track_observations < 2) {
    return OutOfRange("min_track_observations", min_track_observations, "at least 2");
  }
  if (max_dense_frames < 0) return OutOfRange("max_dense_frames", max_dense_frames, "at least 0");
  if (num_threads < 1) return OutOfRange("num_threads", num_threads, "at least 1");
  return std::nullopt;
}

}  // namespace rotslam
