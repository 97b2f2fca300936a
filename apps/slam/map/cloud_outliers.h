#pragma once

#include <optional>
#include <string>

#include "rotodom/types/maps.h"

namespace rotslam {

/// Which points of a cloud are isolated, and whether they are removed.
struct CloudOutlierOptions {
  // Whether points that stand alone leave the cloud.
  bool remove = true;
  // A point leaves when its mean distance from its neighbours is this many standard deviations
  // above the mean over the cloud. Far points of a street are sparse by themselves: less takes
  // them, too.
  double max_sigmas = 3.0;

  std::optional<std::string> Problem() const;

  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("remove", remove);
    visit("max_sigmas", max_sigmas);
  }
};

/// Removes isolated points by PCL's StatisticalOutlierRemoval. All points are kept where the
/// options say so or there are no more points than the neighbours asked for, 16.
/// Throws std::invalid_argument when options.Problem().
PointMap WithoutOutliers(const PointMap& points, const CloudOutlierOptions& options);

}  // namespace rotslam
