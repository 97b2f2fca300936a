#pragma once

#include <vector>

#include "apps/report/figures/drawing.h"
#include "apps/report/run_data.h"

namespace rotslam {

/// One figure for each stage of which the run's files show something; docs/method.md has them.
/// `tracks`, `keyframes`: map_all_frames.bin. `relative_rotations`, `averaging`: view_graph.g2o and
/// ground truth. `sources`: rotations.csv, of given orientations. `view_graph`: view_graph.g2o,
/// loops.csv. `lens`: camera.yaml, summary.json and the calibration. `motion`, `registration`:
/// trajectory_tum.txt, rotations.csv. `known_rotation`, `residuals`: map.bin, summary.json.
/// `rolling_shutter`, `motion_blur`: readout and exposure in summary.json, where they are not zero.
std::vector<Figure> MakeStageFigures(const RunData& run);

}  // namespace rotslam
