#include "krot/krot_options.h"

#include <cmath>

#include "rotodom/types/options.h"
#include "rotodom/types/rotation.h"

namespace rotslam {

std::optional<std::string> KrotOptions::Problem() const {
  if (start != "l1" && start != "bisection" && start != "positioning") {
    return "start is '" + start + "', must be l1, bisection or positioning";
  }
  if (start == "bisection" && !use_bracket) {
    return "start is 'bisection', which needs use_bracket";
  }
  if (!(threshold_px > 0.0)) return OutOfRange("threshold_px", threshold_px, "above 0");
  if (!(threshold_sigmas >= 0.0)) {
    return OutOfRange("threshold_sigmas", threshold_sigmas, "at least 0");
  }
  if (!(loose_factor >= 1.0)) return OutOfRange("loose_factor", loose_factor, "at least 1");
  if (max_bracket_views < 1)
    return OutOfRange("max_bracket_views", max_bracket_views, "at least 1");
  if (max_lp_views < 2) return OutOfRange("max_lp_views", max_lp_views, "at least 2");
  if (observations_per_view < 4) {
    return OutOfRange("observations_per_view", observations_per_view, "at least 4");
  }
  if (!(min_lp_parallax_deg >= 0.0)) {
    return OutOfRange("min_lp_parallax_deg", min_lp_parallax_deg, "at least 0");
  }
  if (!(min_point_angle_deg >= 0.0)) {
    return OutOfRange("min_point_angle_deg", min_point_angle_deg, "at least 0");
  }
  if (!(still_parallax_px >= 0.0)) {
    return OutOfRange("still_parallax_px", still_parallax_px, "at least 0");
  }
  if (min_shared_points < 3) {
    return OutOfRange("min_shared_points", min_shared_points, "at least 3");
  }
  if (!(max_off_axis_deg > 0.0 && max_off_axis_deg < 90.0)) {
    return OutOfRange("max_off_axis_deg", max_off_axis_deg, "between 0 and 90");
  }
  if (num_threads < 1) return OutOfRange("num_threads", num_threads, "at least 1");
  if (const auto trouble = robust_start.Problem()) return "robust_start." + *trouble;
  if (const auto trouble = bisection.Problem()) return "bisection." + *trouble;
  return std::nullopt;
}

KrotUnits::KrotUnits(const KrotOptions& options, const Camera& camera)
    : focal_px(camera.MeanFocal()),
      gamma(options.threshold_px / focal_px),
      still_rad(options.still_parallax_px / focal_px),
      lp_parallax_rad(options.min_lp_parallax_deg * kRadFromDeg),
      point_angle_rad(options.min_point_angle_deg * kRadFromDeg),
      loose_rad(options.loose_factor * options.threshold_px / focal_px),
      min_z(std::cos(options.max_off_axis_deg * kRadFromDeg)) {}

}  // namespace rotslam
