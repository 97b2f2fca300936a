#include "apps/slam/live/live_map.h"

#include <algorithm>

namespace rotslam {

const LivePoint* LiveMap::FindPoint(TrackId track) const {
  const auto point = std::lower_bound(
      points.begin(), points.end(), track, [](const LivePoint& candidate, TrackId sought) {
        return candidate.track < sought;
      });
  return point != points.end() && point->track == track ? &*point : nullptr;
}

}  // namespace rotslam
