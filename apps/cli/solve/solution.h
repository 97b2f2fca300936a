#pragma once

#include <cstddef>
#include <map>
#include <vector>

#include "apps/cli/input/run_options.h"
#include "apps/cli/terminal/progress.h"
#include "apps/slam/map/refinement.h"
#include "apps/slam/map_result.h"
#include "apps/slam/orientations.h"
#include "krot/known_rotation.h"
#include "output/export/known_rotation_file.h"
#include "rotodom/types/maps.h"
#include "rotodom/types/reconstruction.h"

namespace rotslam {

/// How well the orientations are known beforehand, rad about each axis.
using RotationPriors = std::map<FrameId, double>;

/// The solution of a known-rotation problem, in pixels of its images.
struct Solution {
  KrotSolution krot;
  RefinedComponents refined;  // without bundle adjustment: no bundles
  // The maps, largest first, and the component of `refined` that each was made of.
  std::vector<Reconstruction> maps;
  std::vector<std::size_t> component;
};

/// Solves a problem at the size that images of its camera are worked with, since thresholds in
/// pixels are meant for that.
/// @param adjust  followed by bundle adjustment of each component.
Solution SolveAtWorkingSize(const KnownRotationInput& input,
                            const RotationPriors& priors,
                            const RunOptions& options,
                            bool adjust,
                            Progress& progress);

/// A solution in the types that the writers of a run directory take.
struct RunResult {
  Orientations orientations;
  MapResult positions;
};

RunResult AsRun(const KnownRotationInput& input,
                const Solution& solution,
                const RunOptions& options);

}  // namespace rotslam
