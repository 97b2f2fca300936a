#include "rotodom/tracking/view.h"

namespace rotslam {

int CountCommonTracks(const Features& a, const Features& b) {
  return CountCommonTracks(a.tracks, b.tracks);
}

int CountCommonTracks(const std::vector<TrackId>& a, const std::vector<TrackId>& b) {
  int count = 0;
  std::size_t i = 0;
  std::size_t j = 0;
  while (i < a.size() && j < b.size()) {
    const bool i_first = a[i] <= b[j];
    const bool j_first = b[j] <= a[i];
    count += i_first && j_first;
    i += i_first;
    j += j_first;
  }
  return count;
}

}  // namespace rotslam
