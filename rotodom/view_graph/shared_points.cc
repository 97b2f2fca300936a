#include "rotodom/view_graph/shared_points.h"

namespace rotslam {

std::vector<std::array<int, 2>> FindCommonPoints(const Features& view_i, const Features& view_j) {
  std::vector<std::array<int, 2>> keypoints;
  int i = 0;
  int j = 0;
  while (i < view_i.size() && j < view_j.size()) {
    const TrackId track_i = view_i.tracks[i];
    const TrackId track_j = view_j.tracks[j];
    if (track_i == track_j) keypoints.push_back({i, j});
    i += track_i <= track_j;
    j += track_j <= track_i;
  }
  return keypoints;
}

std::vector<SharedPoint> SharedPoints(const Features& i, const Features& j) {
  std::vector<SharedPoint> points;
  for (const auto& [of_i, of_j] : FindCommonPoints(i, j)) {
    points.push_back({i.keypoints_px[of_i], j.keypoints_px[of_j]});
  }
  return points;
}

}  // namespace rotslam
