#pragma once

#include <map>
#include <vector>

#include "rotodom/types/maps.h"

namespace rotslam {

/// How fast the position of a camera becomes uncertain away from the frames that were measured.
///
/// Interpolation and extrapolation are tried on measured frames: for spans of 1, 2, 4, ... frames,
/// the root mean square over all frames, per axis, of what each would have missed. Spans between
/// these are interpolated in the logarithms. Beyond the longest span an interpolated position errs
/// with the power 1.5 of the span, as for a camera whose velocity is a random walk, and a held one
/// in proportion to it.
class PathGrowth {
 public:
  /// @param centers       measured positions of one component.
  /// @param timestamps_s  by frame id.
  PathGrowth(const CenterMap& centers, const std::vector<double>& timestamps_s);

  /// Standard deviation, per axis, of a position interpolated linearly between frames `before_s`
  /// and `after_s` away. Zero where the path is too short to tell.
  double OfInterpolation(double before_s, double after_s) const;

  /// The same for the position of a frame `distance_s` away.
  double OfHolding(double distance_s) const;

 private:
  double interval_s_ = 0.0;                 // median time from frame to frame
  std::map<double, double> interpolation_;  // by span in frames
  std::map<double, double> holding_;
};

}  // namespace rotslam
