#pragma once

#include <vector>

#include "rotodom/types/ids.h"

namespace rotslam {

/// Frames first .. last, both included.
struct FrameRange {
  FrameId first;
  FrameId last;
};

/// A run of frames during which the camera does not change its place.
struct HeldStretch {
  FrameId first;  // its place is the place of all
  FrameId last;
  double evidence = 0.0;  // mean share of the edges across its steps that show no baseline
  std::vector<FrameRange> still = {};  // where it does not turn either, ascending
};

}  // namespace rotslam
