#include "apps/slam/map/some_tracks.h"

#include <algorithm>
#include <map>

#include "rotodom/types/splitmix64.h"

namespace rotslam {

std::vector<Track> SomeTracks(std::vector<Track> tracks, int observations_per_frame) {
  std::sort(tracks.begin(), tracks.end(), [](const Track& a, const Track& b) {
    return HashOf(a.id.value) < HashOf(b.id.value);
  });
  std::map<FrameId, int> count;
  std::erase_if(tracks, [&](const Track& track) {
    const bool is_wanted = std::any_of(
        track.observations.begin(), track.observations.end(), [&](const Observation& observation) {
          return count[observation.frame] < observations_per_frame;
        });
    if (!is_wanted) return true;
    for (const Observation& observation : track.observations) ++count[observation.frame];
    return false;
  });
  return tracks;
}

}  // namespace rotslam
