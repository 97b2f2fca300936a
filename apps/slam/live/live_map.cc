#include "apps/slam/live/live_map.h"

#include <algorithm>
#include <iterator>

namespace rotslam {

const LiveKeyframe* LiveMap::KeyframeAt(FrameId frame) const {
  if (keyframes.empty()) return nullptr;
  const auto after = std::upper_bound(
      keyframes.begin(), keyframes.end(), frame, [](FrameId sought, const LiveKeyframe& keyframe) {
        return sought < keyframe.frame;
      });
  return &*(after == keyframes.begin() ? after : std::prev(after));
}

const LivePoint* LiveMap::FindPoint(TrackId track) const {
  const auto point = std::lower_bound(
      points.begin(), points.end(), track, [](const LivePoint& candidate, TrackId sought) {
        return candidate.track < sought;
      });
  return point != points.end() && point->track == track ? &*point : nullptr;
}

}  // namespace rotslam
