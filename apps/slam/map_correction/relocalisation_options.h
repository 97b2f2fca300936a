#pragma once

#include <optional>
#include <string>

namespace rotslam {

/// Of finding frames again that a map holds in a wrong place, or that only another map holds.
struct RelocalisationOptions {
  bool enabled = true;
  // Corners that a pose must explain. Of wrong places chance explains up to 12 (EuRoC).
  int min_inliers = 30;
  double max_error_px = 4.0;
  // A frame is displaced where another pose explains this many more than its present one, in
  // standard deviations of such a count, the square root of it.
  double min_gain_sigmas = 4.0;

  std::optional<std::string> Problem() const;

  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("enabled", enabled);
    visit("min_inliers", min_inliers);
    visit("max_error_px", max_error_px);
    visit("min_gain_sigmas", min_gain_sigmas);
  }
};

}  // namespace rotslam
