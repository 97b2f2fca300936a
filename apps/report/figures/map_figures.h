#pragma once

#include <vector>

#include "apps/report/figures/drawing.h"
#include "apps/report/run_data.h"

namespace rotslam {

/// Adds the figures of tracks and map, as far as the run has their data: `tracks`, `keyframes` and
/// `registration` of the cloud, `known_rotation` and `residuals` of the keyframes' map.
void AddMapFigures(const RunData& run, std::vector<Figure>& figures);

}  // namespace rotslam
