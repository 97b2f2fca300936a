#include "rotodom/features/view.h"

#include <algorithm>

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

int FindTrack(const Features& features, TrackId track) { return FindTrack(features.tracks, track); }

int FindTrack(const std::vector<TrackId>& tracks, TrackId track) {
  const auto found = std::lower_bound(tracks.begin(), tracks.end(), track);
  if (found == tracks.end() || *found != track) return -1;
  return static_cast<int>(found - tracks.begin());
}

}  // namespace rotslam
