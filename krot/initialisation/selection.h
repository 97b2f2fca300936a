#pragma once

#include <vector>

#include "rotodom/types/maps.h"
#include "rotodom/types/track.h"

namespace rotslam {

/// Selects the tracks that enter the linear programs.
struct SelectionOptions {
  // Observations each view should have in the linear programs. 40 well spread ones hold a view as
  // firmly as all.
  int observations_per_view = 40;
  // Tracks under this parallax come last: their depth is hardly known, and a depth range of 1e6
  // instead of about 50 spoils the programs' conditioning.
  double min_parallax_rad = 0.0175;
  int grid_columns = 8;  // cells over each view's own observations
  int grid_rows = 5;
};

/// Selects tracks that cover the image of every view evenly, long tracks with parallax first.
/// Returns their indices in `tracks`, ascending. The order of the tracks matters only between equal
/// ones.
std::vector<int> SelectTracks(const RotationMap& cam_from_world,
                              const std::vector<Track>& tracks,
                              const SelectionOptions& options);

}  // namespace rotslam
