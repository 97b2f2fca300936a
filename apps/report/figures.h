#pragma once

#include <string>
#include <vector>

#include "apps/report/drawing.h"
#include "apps/report/run_data.h"

namespace rotslam {

struct Figure {
  std::string name;  // of its files, without ending
  Drawing drawing;
};

/// The figures of a run that its files allow: `trajectory` (from above and from the side) where
/// there are positions, `orientation`, `errors` where there is ground truth, `runtime`.
std::vector<Figure> MakeFigures(const RunData& run);

}  // namespace rotslam
