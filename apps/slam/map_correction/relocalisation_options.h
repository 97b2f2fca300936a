#pragma once

#include <optional>
#include <string>

namespace rotslam {

/// Options of Relocalise, which finds frames that a map has in a wrong place or not at all.
struct RelocalisationOptions {
  bool enabled = true;
  // Corners that a pose must explain. Of wrong places chance explains up to 12 (EuRoC).
  int min_inliers = 30;

  std::optional<std::string> Problem() const;

  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("enabled", enabled);
    visit("min_inliers", min_inliers);
  }
};

}  // namespace rotslam
