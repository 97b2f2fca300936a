#include "apps/slam/map_correction/relocalisation_options.h"

#include "rotodom/types/options.h"

namespace rotslam {

std::optional<std::string> RelocalisationOptions::Problem() const {
  if (min_inliers < 4) return OutOfRange("min_inliers", min_inliers, "at least 4");
  if (!(max_error_px > 0.0)) return OutOfRange("max_error_px", max_error_px, "positive");
  if (!(min_gain_sigmas > 0.0)) return OutOfRange("min_gain_sigmas", min_gain_sigmas, "positive");
  return std::nullopt;
}

}  // namespace rotslam
