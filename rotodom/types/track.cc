#include "rotodom/types/track.h"

namespace rotslam {

int NumObservations(const std::vector<Track>& tracks) {
  std::size_t count = 0;
  for (const Track& track : tracks) count += track.observations.size();
  return static_cast<int>(count);
}

}  // namespace rotslam
