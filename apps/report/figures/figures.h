#pragma once

#include <vector>

#include "apps/report/figures/drawing.h"
#include "apps/report/run_data.h"

namespace rotslam {

/// The figures of a run that its files allow: `trajectory` (from above and from the side) where
/// there are positions, `orientation`, `errors` where there is ground truth, `runtime`, and those
/// of MakeStageFigures.
std::vector<Figure> MakeFigures(const RunData& run);

}  // namespace rotslam
