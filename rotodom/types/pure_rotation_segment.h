#pragma once

#include <algorithm>
#include <vector>

#include "rotodom/types/ids.h"

namespace rotslam {

/// Frames first .. last, both included.
struct FrameRange {
  FrameId first;
  FrameId last;
};

/// A run of frames during which the camera does not change its place.
struct PureRotationSegment {
  FrameId first;  // its place is the place of all
  FrameId last;
  double evidence = 0.0;  // mean share of the edges across its steps that show no baseline
  std::vector<FrameRange> still = {};  // where it does not turn either, ascending
};

/// The one that `frame` lies in; null when there is none.
inline const PureRotationSegment* SegmentAt(const std::vector<PureRotationSegment>& held,
                                            FrameId frame) {
  const auto stretch = std::find_if(held.begin(), held.end(), [&](const PureRotationSegment& s) {
    return s.first <= frame && frame <= s.last;
  });
  return stretch == held.end() ? nullptr : &*stretch;
}

}  // namespace rotslam
