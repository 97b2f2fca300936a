#include "krot/krot_options.h"

#include <cmath>

#include "rotodom/types/options.h"
#include "rotodom/types/rotation.h"

namespace rotslam {
namespace {

// Tracks under this parallax come into the linear programs last, for the sake of conditioning:
// their depth is nearly sixty times their baseline.
constexpr double kMinLpParallaxDeg = 1.0;
// Below this flow beyond rotation a track says nothing of positions; noise and rotation error alone
// reach a few px.
constexpr double kStillParallaxPx = 4.0;
// Observations further than this off the optical axis have no bounded image coordinates and stay
// out of the linear programs (they are triangulated all the same). At 80 deg a pixel's bound has
// grown by 33, the squared reciprocal of the cosine.
constexpr double kMaxOffAxisDeg = 80.0;

}  // namespace

std::span<const char* const> OptionWords(KrotStart) {
  static constexpr const char* kWords[] = {"l1", "bisection", "positioning"};
  return kWords;
}

std::optional<std::string> KrotOptions::Problem() const {
  if (start == KrotStart::kBisection && !use_bracket) {
    return "start is 'bisection', which needs use_bracket";
  }
  if (!(threshold_px > 0.0)) return OutOfRange("threshold_px", threshold_px, "above 0");
  if (!(loose_factor >= 1.0)) return OutOfRange("loose_factor", loose_factor, "at least 1");
  if (max_bracket_views < 1)
    return OutOfRange("max_bracket_views", max_bracket_views, "at least 1");
  if (max_lp_views < 2) return OutOfRange("max_lp_views", max_lp_views, "at least 2");
  if (observations_per_view < 4) {
    return OutOfRange("observations_per_view", observations_per_view, "at least 4");
  }
  if (!(min_point_angle_deg >= 0.0)) {
    return OutOfRange("min_point_angle_deg", min_point_angle_deg, "at least 0");
  }
  if (num_threads < 1) return OutOfRange("num_threads", num_threads, "at least 1");
  if (const auto trouble = bisection.Problem()) return "bisection." + *trouble;
  return std::nullopt;
}

KrotUnits::KrotUnits(const KrotOptions& options, const Camera& camera)
    : focal_px(camera.MeanFocal()),
      gamma(options.threshold_px / focal_px),
      still_rad(kStillParallaxPx / focal_px),
      lp_parallax_rad(kMinLpParallaxDeg * kRadFromDeg),
      point_angle_rad(options.min_point_angle_deg * kRadFromDeg),
      loose_rad(options.loose_factor * options.threshold_px / focal_px),
      min_z(std::cos(kMaxOffAxisDeg * kRadFromDeg)) {}

}  // namespace rotslam
