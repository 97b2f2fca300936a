#include "apps/slam/map_correction/relocalisation_options.h"

#include "rotodom/types/options.h"

namespace rotslam {

std::optional<std::string> RelocalisationOptions::Problem() const {
  if (min_inliers < 4) return OutOfRange("min_inliers", min_inliers, "at least 4");
  return std::nullopt;
}

}  // namespace rotslam
