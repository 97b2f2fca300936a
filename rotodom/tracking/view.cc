#include "rotodom/tracking/view.h"

namespace rotslam {

int CountCommonTracks(const Features& a, const Features& b) {
  int count = 0;
  std::size_t i = 0;
  std::size_t j = 0;
  while (i < a.tracks.size() && j < b.tracks.size()) {
    const bool i_first = a.tracks[i] <= b.tracks[j];
    const bool j_first = b.tracks[j] <= a.tracks[i];
    count += i_first && j_first;
    i += i_first;
    j += j_first;
  }
  return count;
}

}  // namespace rotslam
