#pragma once

#include <vector>

#include "apps/report/figures/drawing.h"
#include "apps/report/run_data.h"

namespace rotslam {

/// Adds the figures of the orientations, as far as the run has their data: `relative_rotations` and
/// `averaging` (against ground truth), `view_graph`, `motion` (with positions) and `sources`.
void AddRotationFigures(const RunData& run, std::vector<Figure>& figures);

}  // namespace rotslam
