#include "krot/initialisation/selection.h"

#include <algorithm>
#include <map>
#include <tuple>

#include "krot/structure/components.h"

namespace rotslam {
namespace {

struct Candidate {
  int track;
  Eigen::Vector2d xy;
};

// Cells of one view in row order, each with its tracks in order of rank.
std::vector<std::vector<int>> SortIntoCells(const std::vector<Candidate>& candidates,
                                            const std::vector<int>& rank,
                                            const SelectionOptions& options) {
  Eigen::Array2d low = Eigen::Array2d::Constant(1e300);
  Eigen::Array2d high = Eigen::Array2d::Constant(-1e300);
  for (const Candidate& candidate : candidates) {
    low = low.min(candidate.xy.array());
    high = high.max(candidate.xy.array());
  }
  const Eigen::Array2d size = (high - low).max(1e-12);
  const Eigen::Array2d counts(options.grid_columns, options.grid_rows);
  std::vector<std::vector<int>> cells(options.grid_columns * options.grid_rows);
  for (const Candidate& candidate : candidates) {
    const Eigen::Array2d position = (candidate.xy.array() - low) / size * counts;
    const int column = std::clamp(static_cast<int>(position.x()), 0, options.grid_columns - 1);
    const int row = std::clamp(static_cast<int>(position.y()), 0, options.grid_rows - 1);
    cells[row * options.grid_columns + column].push_back(candidate.track);
  }
  for (std::vector<int>& cell : cells) {
    std::sort(cell.begin(), cell.end(), [&](int a, int b) { return rank[a] < rank[b]; });
  }
  return cells;
}

// Rank of each track: enough parallax first, then longer, then earlier.
std::vector<int> RankTracks(const RotationMap& cam_from_world,
                            const std::vector<Track>& tracks,
                            const SelectionOptions& options) {
  std::vector<std::tuple<bool, int, int>> keys;
  for (std::size_t t = 0; t < tracks.size(); ++t) {
    const bool shallow = TrackParallax(cam_from_world, tracks[t]) < options.min_parallax_rad;
    const int length = static_cast<int>(tracks[t].observations.size());
    keys.emplace_back(shallow, -length, static_cast<int>(t));
  }
  std::sort(keys.begin(), keys.end());
  std::vector<int> rank(tracks.size());
  for (std::size_t k = 0; k < keys.size(); ++k) rank[std::get<2>(keys[k])] = static_cast<int>(k);
  return rank;
}

}  // namespace

std::vector<int> SelectTracks(const RotationMap& cam_from_world,
                              const std::vector<Track>& tracks,
                              const SelectionOptions& options) {
  const std::vector<int> rank = RankTracks(cam_from_world, tracks, options);
  std::map<FrameId, std::vector<Candidate>> candidates_of;
  for (std::size_t t = 0; t < tracks.size(); ++t) {
    for (const Observation& observation : tracks[t].observations) {
      candidates_of[observation.frame].push_back(
          {static_cast<int>(t), observation.bearing.head<2>() / observation.bearing.z()});
    }
  }
  std::vector<bool> selected(tracks.size(), false);
  std::map<FrameId, int> count;
  for (const auto& [view, candidates] : candidates_of) {
    const auto cells = SortIntoCells(candidates, rank, options);
    // Each round takes the next track of every cell.
    bool left = true;
    for (std::size_t round = 0; left && count[view] < options.observations_per_view; ++round) {
      left = false;
      for (const std::vector<int>& cell : cells) {
        if (round >= cell.size()) continue;
        left = true;
        const int track = cell[round];
        if (selected[track] || count[view] >= options.observations_per_view) continue;
        selected[track] = true;
        for (const Observation& observation : tracks[track].observations) {
          ++count[observation.frame];
        }
      }
    }
  }
  std::vector<int> result;
  for (std::size_t t = 0; t < tracks.size(); ++t) {
    if (selected[t]) result.push_back(static_cast<int>(t));
  }
  return result;
}

}  // namespace rotslam
